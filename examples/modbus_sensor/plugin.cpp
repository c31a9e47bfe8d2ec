// The library: the driver, and the device that it is tried with.
#include "core/component/plugin.hpp"

#include "simulated_thermometer.hpp"
#include "thermometer.hpp"

INVAR_PLUGIN(registry) {
  registry.add<Thermometer>("thermometer", "temperature of a sensor on Modbus TCP");
  registry.add<SimulatedThermometer>("simulated_thermometer", "such a sensor, simulated");
}
