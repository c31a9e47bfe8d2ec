// machine.yaml: chain, travel, tool and resolution of a machine; for a simulated one its hidden errors too.
//
// This room stands between config and metrology: metrology knows neither YAML nor files, config knows no
// machine. Tools and the component `world` read the same file with the same words.
#pragma once

#include <filesystem>

#include "core/config/yaml.hpp"
#include "core/metrology/geometric/machine.hpp"

namespace invar::machine {

/// Reads
///
///     invar_machine: 1
///     chain: [y, x, z]                                       # from the workpiece side; two axes for an XY table
///     travel: {x: [0, 0.2], y: [0, 0.2], z: [0, 0.1]}        # m
///     tool: {x: 0, y: 0, z: 0}                               # m, optional
///     resolution: {x: 1e-6, y: 1e-6, z: 1e-6}                # m, optional
///     errors:                                                # optional: of a simulated machine
///       EYX: {polynomial: [0, 2e-5], harmonics: [{amplitude: 2e-6, period: 0.13, phase: 0.4}]}
///       ECX: {table: {position: [0, 0.1, 0.2], value: [0, 4e-6, 1e-5]}}
///       EC0Y: {value: 30, unit: arcsec}                      # squareness, ISO sign (EB0Z, EA0Z likewise)
///       reversal: {x: 1.5e-6}                                # m, lost motion of an axis; or a function as above
///       expansion: {x: 11.5e-6}                              # 1/K, with the slide's temperature
///       bending: {x: 2e-6}                                   # m/K at mid travel, likewise
///       base_expansion: {x: 3e-6}                            # 1/K, with the base's temperature
///       scale_lag: 300                                       # s, of the scale behind the slide's thermometer
///       reference_temperature: 20                            # degC
///
/// A function of q [m] in m or rad is a sum: c_k q^k, amplitude sin(2 pi q / period + phase), and the table
/// (cubic, end values held). A single stage has one axis, where the reader allows it. Faults go to the document's list; the
/// caller ends with `Yaml::finish()`.
metrology::Machine read_machine(const config::Node& root, int least_axes = 2);

/// Loads a file that holds a machine and nothing else. Throws InputError with every fault.
metrology::Machine load_machine(const std::filesystem::path& file, int least_axes = 2);

}  // namespace invar::machine
