// YAML files of every kind, tables, formulas and units.
#include <zlib.h>

#include <fstream>
#include <iterator>

#include "core/base/unit.hpp"
#include "core/compensation/component_file.hpp"
#include "core/compensation/fusion_file.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/rotary_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/profile.hpp"
#include "core/machine/machine_file.hpp"
#include "core/modbus/fault_script.hpp"
#include "core/modbus/map.hpp"
#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/expression.hpp"
#include "core/physics/expression_units.hpp"
#include "core/vision/camera_file.hpp"
#include "core/vision/ruler_file.hpp"
#include "tests/fuzz/targets.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/deploy/archive.hpp"
#include "tools/geometric/lines_file.hpp"

namespace invar::fuzz {

namespace {

namespace fs = std::filesystem;
const fs::path source = INVAR_SOURCE_DIR;

Bytes content_of(const fs::path& file) {
  std::ifstream stream{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

/// The YAML files below a folder whose first key is `key`.
std::vector<Bytes> files_with(const fs::path& folder, const std::string& key) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator{folder})
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<Bytes> found;
  for (const auto& file : files) {
    const Bytes bytes = content_of(file);
    const std::string text{bytes.begin(), bytes.end()};
    if (text.find(key + ":") != std::string::npos) found.push_back(bytes);
  }
  return found;
}

std::vector<Bytes> texts(std::initializer_list<std::string> all) {
  std::vector<Bytes> seeds;
  for (const auto& text : all) seeds.push_back(bytes_of(text));
  return seeds;
}

Bytes gzipped(const Bytes& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  Bytes out(bytes.size() + 1024);
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

const std::string thermal_model =
    "invar_model: 1\nplant: thermal\ncolumns: {time: t}\nnodes:\n"
    "  slide: {column: T_s, capacity: {value: 900, unit: J/K, sigma: 20}, loss: {value: 2, unit: W/K}}\n"
    "  base: {column: T_b, capacity: {value: 5000, unit: J/K}, loss: {value: 3, unit: W/K}}\n"
    "heaters: {pad: {node: slide, column: P, gain: {value: 1.0, unit: W/W}}}\n"
    "couplings:\n  - {between: [slide, base], conductance: {value: 4, unit: W/K}}\n"
    "ambient: {value: 20, unit: degC}\nnoise: {T_s: 0.01}\n"
    "terms:\n  - {term: radiation, node: slide, emissivity_area: {value: 0.1, unit: m2}}\n";
const std::string equations_model =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u, v: {column: v, hold: linear, unit: "
    "mL/s}}\n"
    "states:\n  x: {derivative: \"(u - k*x)/tau\", initial: {value: 0, unit: m}}\n"
    "  y: {derivative: \"if(x > 1, sin(t), -y^2) + v\", initial: 0}\n"
    "outputs: {p: {column: p, expression: \"x + 0.1*y\", limits: [-1, 5]}}\n"
    "parameters: {k: {value: 1.5, unit: 1, sigma: 0.1}, tau: {value: 3, unit: s}}\n"
    "controller: {output: w, expression: \"k*(1-x)\"}\nterms: []\n";
const std::string axis_model =
    "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: x, current: i}\n"
    "controller: {kind: pid, rate: 1000, kp: 5e4, ki: 8e5, kd: 200, limit: 4}\n"
    "parameters:\n  mass: {value: 3.2, unit: kg, sigma: 0.06}\n  motor_constant: {value: 35, unit: N/A}\n"
    "  viscous_damping: {value: 20, unit: N s/m}\nnoise: {x: 1e-8}\n"
    "terms:\n  - {term: coulomb_friction, level: {value: 2, unit: N}, width: {value: 1e-4, unit: m/s}}\n";
const std::string droplet_compensation =
    "invar_compensation: 1\nkind: dispenser\nplacement: [2e-6, 1.182e-4]\nslope: [5.3e-3, 9e-5]\nslowness: "
    "0.5\n"
    "delay: 2e-4\ncovariance: [1e-12, 0, 0, 1e-12]\nslowness_sigma: 0.1\ndelay_sigma: 1e-5\nheight: [0.002, "
    "0.02]\n";

Target yaml_target(const std::string& name, std::vector<Bytes> seeds,
                   std::function<void(const config::Yaml&)> read) {
  return {name,
          ".yaml",
          std::move(seeds),
          {"invar_compensation: 1\n", "kind: ", "[1, 2", "{value: ", "unit: mm"},
          [read = std::move(read)](const Bytes&, const fs::path& file) { read(config::Yaml::load(file)); }};
}

/// A compensation of one kind: what precedes its own keys is read as the commands do.
Target compensation_target(const std::string& name, std::vector<Bytes> seeds,
                           std::function<void(const config::Node&)> read) {
  return yaml_target(name, std::move(seeds), [read = std::move(read)](const config::Yaml& yaml) {
    const auto root = yaml.root();
    (void)root.integer("invar_compensation", 1, 1);
    (void)root.text("kind");
    (void)root.text("checksum", "");
    root["identified_from"].accept_all();
    read(root);
    yaml.finish();
  });
}

std::string fusion_compensation() {
  compensation::FusionFile file;
  file.sensors.position_names = {"encoder"};
  file.sensors.velocity_names = {"tacho"};
  file.sensors.positions = {{2e-3, 1.0 / 3.0e4, 1e-4, 2e-4, 2e-6, 0}};
  file.sensors.velocities.resize(1);
  file.sensors.velocities[0].gains = {0.99, -0.1, 1.0 / 7.0, 0.0};
  file.sensors.start_sigma = 1e-4;
  compensation::ModelText text{"fusion", {}};
  compensation::write_fusion(text, file);
  return text.sealed();
}

std::string trajectory_compensation() {
  metrology::DropletTrajectory trajectory;
  trajectory.placement = {2e-6, 1.182e-4};
  trajectory.slope = {5.3e-3, 9e-5};
  trajectory.covariance = Eigen::Matrix2d::Identity() * 1e-12;
  trajectory.least_height = 0.002;
  trajectory.most_height = 0.02;
  compensation::ModelText text{"dispenser", {}};
  compensation::write_trajectory(text, trajectory);
  return text.sealed();
}

std::string thermal_compensation() {
  metrology::ThermalError model;
  model.x = {0.0, 0.2};
  model.temperature = {26.9, 30.1};
  model.heating_rate = {0.0, 0.0};
  model.noise = 2e-7;
  for (const auto factor : {metrology::ThermalFactor::geometry, metrology::ThermalFactor::temperature_curve})
    model.terms.push_back(
        {factor, -0.05, 0.05, Eigen::MatrixXd::Constant(7, metrology::factor_count(factor), 1e-6)});
  model.sigma_table = {{numerics::GridAxis{model.x, 2}, numerics::GridAxis{model.temperature, 2},
                        numerics::GridAxis{model.heating_rate, 1}},
                       std::vector<double>{1e-7, 2e-7, 3e-7, 4e-7}};
  compensation::ModelText text{"thermal", {}};
  compensation::write_thermal(text, model);
  return text.sealed();
}

std::string geometric_compensation() {
  metrology::GeometricModel model;
  model.chain = {{1, 0, 2}, 2};
  model.travel = {Range{0.0, 0.2}, Range{0.0, 0.2}, Range{0.0, 0.0}};
  compensation::ModelText text{"geometric", {}};
  compensation::write_geometric(text, model);
  return text.sealed();
}

std::string rotary_compensation() {
  metrology::ErrorMotionReadings readings;
  readings.position = Eigen::VectorXd::LinSpaced(40, 0.0, 6.283);
  readings.value = 1e-5 * readings.position.array().sin();
  readings.state.resize(0, 40);
  for (int i = 0; i < 40; ++i) readings.direction.push_back(i % 4 < 2 ? 1 : -1);
  for (int i = 0; i < 40; ++i) readings.position[i] = readings.position[2 * (i / 2)];
  compensation::ModelText text{"rotary", {}};
  compensation::write_rotary(text, metrology::identify_rotary('c', readings, {0.0, 6.283}).axis);
  return text.sealed();
}

const std::string recorded =
    "t [s],r [m],x [m],i [A],note\n0,0,0,0.1,1\n0.001,1e-6,0,0.2,\n0.002,2e-6,1e-6,nan,3\n"
    "0.003,3e-6,\"2e-6\",-0.1,4\n";
const std::string lines =
    "line,x [mm],y [mm],displacement [mm],temperature [degC],direction "
    "[1]\nX1,0,0,0,20,1\nX1,100,0,100.001,20,1\n"
    "X1,200,0,200.003,20.5,-1\n\"Y 1\",0,0,0,21,1\n\"Y 1\",0,100,99.998,21,1\n\"Y 1\",0,200,199.999,21,1\n";

const std::string renishaw =
    "HEADER::\r\nFile Type: linear\r\n\r\nTARGET DATA::\r\nTargets :\r\n0 50,5\r\n100\r\nFlags: "
    "1\r\n\r\nUSER-TEXT::\r\n"
    "Axis: X\r\n\r\nDEVIATIONS::\r\nRun Target Data:\r\n 1 1 0.1\r\n 1 2 1.1\r\n 1 3 2\r\n 2 3 2.2\r\n 2 2 "
    "1\r\n 2 1 -0,1\r\n";

void read_table(const fs::path& file) {
  const auto model = model::read(config::Yaml::parse(axis_model, file.string()));
  for (const auto& table : model::read_recording(file, model)) {
    const auto record = model::to_record(table, model, false);
    model::check_order(model, record.record, file);
  }
}

}  // namespace

std::vector<Target> text_targets() {
  std::vector<Target> all;
  // --- cells: a few, since each is made whole
  auto cells = files_with(source / "deployment", "invar_cell");
  cells.push_back(content_of(source / "tests/data/invalid/cell/component_twice.yaml"));
  all.push_back({"cell",
                 ".yaml",
                 std::move(cells),
                 {"type: stage", "connect: {", "realtime: {"},
                 [](const Bytes&, const fs::path& file) {
                   for (const char* beside : {"profiles.yaml", "maps", "machines", "ruler.yaml"}) {
                     std::error_code there;
                     fs::create_symlink(source / "deployment" / beside, file.parent_path() / beside, there);
                   }
                   (void)tools::load_cell(file);
                 }});
  all.push_back(yaml_target("machine", files_with(source / "deployment" / "machines", "invar_machine"),
                            [](const config::Yaml& yaml) {
                              (void)machine::read_machine(yaml.root());
                              yaml.finish();
                            }));
  auto models = files_with(source / "deployment" / "machines", "invar_model");
  for (const auto& text : {thermal_model, equations_model, axis_model}) models.push_back(bytes_of(text));
  all.push_back(yaml_target("model", std::move(models), [](const config::Yaml& yaml) {
    const auto read = model::read(yaml);
    yaml.finish();
    (void)model::patched(yaml, read);
  }));
  const auto maps = files_with(source / "deployment" / "maps", "invar_modbus_map");
  all.push_back({"register_map",
                 ".yaml",
                 maps,
                 {"access: write", "read_back: self"},
                 [](const Bytes&, const fs::path& file) { (void)modbus::load_map(file); }});
  all.push_back({"fault_script",
                 ".yaml",
                 texts({"invar_modbus_faults: 1\nfaults:\n  - {at: 10, for: 2, do: refuse}\n"
                        "  - {at: 30, for: 5, do: exception, code: 6, on: writes}\n"}),
                 {"do: delay, by: 0.4"},
                 [heater = modbus::load_map(source / "deployment/maps/heater.yaml")](
                     const Bytes&, const fs::path& file) { (void)modbus::load_faults(file, heater); }});
  all.push_back({"profiles",
                 ".yaml",
                 {content_of(source / "deployment" / "profiles.yaml")},
                 {"durability: "},
                 [](const Bytes&, const fs::path& file) { (void)dds::load_profiles(file); }});
  all.push_back({"ruler",
                 ".yaml",
                 {content_of(source / "deployment" / "ruler.yaml")},
                 {"circles:"},
                 [](const Bytes&, const fs::path& file) { (void)vision::read_ruler(file); }});
  all.push_back({"camera",
                 ".yaml",
                 texts({"invar_camera: 1\nmodel: scale\nimage: {width: 640, height: 480}\n"
                        "scale: {value: 5e-6, unit: m/px, sigma: 1e-9}\naspect: {value: 1.001, unit: \"1\"}\n"
                        "distortion:\n  radial: {value: 1e-9, unit: 1/px2}\n  center: [320, 240]\n"}),
                 {"sigma: "},
                 [](const Bytes&, const fs::path& file) { (void)vision::read_camera(file); }});
  all.push_back(compensation_target("fusion", texts({fusion_compensation()}),
                                    [](const config::Node& root) { (void)compensation::read_fusion(root); }));
  all.push_back(
      compensation_target("trajectory", texts({trajectory_compensation(), droplet_compensation}),
                          [](const config::Node& root) { (void)compensation::read_trajectory(root); }));
  all.push_back(compensation_target("thermal", texts({thermal_compensation()}), [](const config::Node& root) {
    (void)compensation::read_thermal(root);
  }));
  all.push_back(
      compensation_target("geometric", texts({geometric_compensation()}),
                          [](const config::Node& root) { (void)compensation::read_geometric(root); }));
  all.push_back(
      compensation_target("components", texts({geometric_compensation()}),
                          [](const config::Node& root) { (void)compensation::read_components(root); }));
  all.push_back(compensation_target("rotary", texts({rotary_compensation()}),
                                    [](const config::Node& root) { (void)compensation::read_rotary(root); }));
  const std::string archive =
      tools::archive_of({{"BACKUP", "invar_backup: 1\n"}, {"data/state/models.yaml", "a: 1\n"}});
  all.push_back({"backup",
                 ".tar",
                 texts({archive}),
                 {"../", std::string(512, '\0')},
                 [](const Bytes& bytes, const fs::path& file) {
                   (void)tools::read_archive({bytes.begin(), bytes.end()}, file.string());
                 }});
  // --- tables
  const auto read_csv = [](const Bytes&, const fs::path& file) { read_table(file); };
  all.push_back({"recording_csv", ".csv", texts({recorded}), {" [mm]", "nan", ",,", "\"a,b\""}, read_csv});
  all.push_back({"recording_csv_gz", ".csv.gz", {gzipped(bytes_of(recorded))}, {}, read_csv});
  all.push_back({"lines",
                 ".csv",
                 texts({lines}),
                 {"tool_x [mm]", "\xC2\xB5m"},
                 [table = machine::load_machine(source / "deployment/machines/xy-table.yaml")](
                     const Bytes&, const fs::path& file) { (void)tools::read_lines(file, table); }});
  all.push_back({"rtl",
                 ".rtl",
                 texts({renishaw}),
                 {"HEADER::", "TARGET DATA::", "DEVIATIONS::", "Filetype: angular", " 1 1 "},
                 [table = machine::load_machine(source / "deployment/machines/xy-table.yaml")](
                     const Bytes&, const fs::path& file) { (void)tools::read_lines(file, table); }});
  // --- formulas and units
  all.push_back(
      {"formula",
       "",
       texts({"(u - k*x)/tau", "if(x > 1, sin(t), -x^2) + min(1, x, u)"}),
       {"tanh(", "pi", "if(", "&&", "1e9"},
       [](const Bytes& input, const fs::path&) {
         const std::string formula{input.begin(), input.end()};
         const std::vector<std::string> names{"t", "x", "u", "k", "tau"};
         const physics::UnitsOfNames units{{"x", {"m", *parse_unit("m")}}, {"tau", {"s", *parse_unit("s")}}};
         (void)physics::clash_of_units(formula, units, names, std::nullopt);
       }});
  all.push_back({"unit",
                 "",
                 texts({"N s/m", "1/(K s2)", "um^2", "\xC2\xB0\x43/min"}),
                 {"((", "^9", "kk"},
                 [](const Bytes& input, const fs::path&) {
                   const std::string text{input.begin(), input.end()};
                   if (const auto unit = parse_unit(text)) (void)si_unit(*unit);
                   (void)conversion(text, "m/s");
                 }});
  return all;
}

}  // namespace invar::fuzz
