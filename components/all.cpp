#include "components/all.hpp"

#include "components/calibration/axis_trial.hpp"
#include "components/calibration/calibration.hpp"
#include "components/calibration/fusion_trial.hpp"
#include "components/compensation/compensation.hpp"
#include "components/dispenser/dispenser.hpp"
#include "components/dispenser/valve.hpp"
#include "components/fusion/fusion.hpp"
#include "components/interferometer/interferometer.hpp"
#include "components/recorder/recorder.hpp"
#include "components/stage/axis_stage.hpp"
#include "components/supervisor/supervisor.hpp"
#include "components/thermal/thermal.hpp"
#include "components/vision/folder_camera.hpp"
#include "components/vision/simulated_camera.hpp"
#include "components/vision/vision_component.hpp"
#include "components/watch/model_watch.hpp"
#include "components/world/simulated_heater.hpp"
#include "components/world/simulated_pneumatics.hpp"
#include "components/world/simulated_sensor.hpp"
#include "components/world/simulated_stage.hpp"
#include "components/world/simulated_substrate.hpp"

namespace invar {

void add_all_components(Registry& registry) {
  registry.add<world::SimulatedStage>("simulated_stage",
                                      "drives, encoders and true tool position of a machine");
  registry.add<world::SimulatedSensor>("simulated_sensor",
                                       "imperfect position or velocity sensor of a simulated axis");
  registry.add<world::SimulatedHeater>("simulated_heater",
                                       "pad, slide and base behind a heater controller's registers");
  registry.add<world::SimulatedPneumatics>(
      "simulated_pneumatics", "reservoir and regulator behind a pressure controller's registers");
  registry.add<world::SimulatedSubstrate>("simulated_substrate",
                                          "flight and landing of the droplets of a valve");
  registry.add<dispenser::Dispenser>("dispenser", "pressure over Modbus TCP, patterns and where to aim them");
  registry.add<dispenser::Valve>("valve", "jets droplets at the right place, in the loop");
  registry.add<thermal::Thermal>("thermal", "temperature loop with a heater over Modbus TCP");
  registry.add<fusion::Fusion>("fusion", "one position of an axis from its encoder and velocity sensor");
  registry.add<interferometer::Interferometer>("interferometer", "displacement laser");
  registry.add<calibration::Calibration>("calibration", "measures, identifies, activates, verifies");
  registry.add<calibration::AxisTrial>("axis_trial",
                                       "force ripple and tracking error of one axis, measured by jobs");
  registry.add<calibration::FusionTrial>(
      "fusion_trial", "the sensors of an axis identified beside a laser, their fusion in use");
  registry.add<compensation::Compensation>("compensation", "corrects the setpoints of the axes, live");
  registry.add<recorder::Recorder>("recorder", "writes what the cell says to an MCAP file");
  registry.add<vision::FolderCamera>("folder_camera", "pictures of a folder as a camera's frames");
  registry.add<vision::SimulatedCamera>("simulated_camera", "frames of a camera over the stage");
  registry.add<vision::Vision>("vision", "droplets in frames, in machine coordinates; the camera's scale");
  registry.add<stage::Stage>("stage", "servo of one axis");
  registry.add<watch::ModelWatch>("model_watch", "says when an axis and its model part, and where");
  registry.add<supervisor::Supervisor>(
      "supervisor", "watches processes and components, makes safe what depends on lost ones");
}

}  // namespace invar
