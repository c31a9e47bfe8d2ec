// Requests to vision over DDS: this program asks, another process of it has the camera and vision.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>

#include "components/vision/simulated_camera.hpp"
#include "components/vision/vision_component.hpp"
#include "core/executor/executor.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/dds/domain.hpp"

namespace invar::vision {
namespace {

using dds::testing::eventually;

std::string topic(const std::string& port) { return "cell/test/" + port; }

/// Runs camera and vision until its input ends. The ruler lies in the middle of what the camera sees.
int serve(const std::filesystem::path& ruler, std::uint32_t domain) {
  dds::NodeOptions options = dds::testing::local("vision");
  options.domain = domain;
  dds::Node node{options, dds::standard_profiles()};
  SimulatedCamera::Parameters seeing;
  seeing.ruler = SimulatedCamera::Ruler{ruler, {0.0, 0.0}};
  seeing.dust = 5;
  Vision::Parameters measuring;
  measuring.ruler = ruler;
  measuring.out = ruler.parent_path().string();
  measuring.patience = 5.0;
  ExecutorOptions worker;
  worker.period = Duration::milliseconds(10);
  Executor executor{worker};
  executor.add(std::make_unique<SimulatedCamera>(seeing));
  executor.add(std::make_unique<Vision>(measuring));
  for (const std::size_t i : {0U, 1U})
    for (Port* port : executor.component(i).ports()) {
      port->topic = topic(port->name());
      if (port->direction() == Port::Direction::output)
        node.bind(static_cast<OutputPort&>(*port), {});
      else
        node.bind(static_cast<InputPort&>(*port));
    }
  executor.start();
  node.start();
  for (const Transition transition : {Transition::configure, Transition::activate})
    for (const std::size_t i : {0U, 1U})
      if (!executor.transition(i, transition).ok()) return 1;
  std::cout << "ready" << std::endl;
  char byte = 0;
  while (read(0, &byte, 1) > 0) {
  }
  executor.stop();
  node.stop();
  return 0;
}

TEST(VisionOverDds, CalibratesAndMeasuresOnRequestFromAnotherProcess) {
  const invar::testing::TemporaryFolder folder;
  std::ofstream{folder / "ruler.yaml"} << "circles:\n  - {radius: 4.0e-4, at: [-2.0e-3, 1.0e-3]}\n"
                                          "  - {radius: 5.0e-4, at: [-1.2e-3, -1.0e-3]}\n"
                                          "  - {radius: 6.0e-4, at: [2.2e-3, -0.5e-3]}\n";
  dds::Node node{dds::testing::local("asker"), dds::standard_profiles()};
  std::mutex mutex;
  image::VisionStatus status;
  std::optional<image::DropletsMeasured> droplets;
  const auto status_reader =
      node.reader<image::VisionStatus>(topic("status"), "state", [&](const image::VisionStatus& sample) {
        const std::lock_guard lock{mutex};
        status = sample;
      });
  const auto droplets_reader = node.reader<image::DropletsMeasured>(
      topic("droplets"), "event", [&](const image::DropletsMeasured& sample) {
        const std::lock_guard lock{mutex};
        droplets = sample;
      });
  auto writer = node.writer<image::VisionCommand>(topic("command"), "command");
  test::Process other{{std::filesystem::canonical("/proc/self/exe").string(), "--serve",
                       (folder / "ruler.yaml").string(), std::to_string(dds::testing::test_domain())}};
  ASSERT_EQ(other.line(), "ready");
  ASSERT_TRUE(eventually([&] { return writer.connection().matched() > 0; }));

  const auto ask = [&](std::uint64_t id, image::VisionTask task, const std::string& picture) {
    image::VisionCommand command;
    command.id(id);
    command.wanted(task);
    command.picture_path(picture);
    writer.write(command);
    return eventually([&] {
      const std::lock_guard lock{mutex};
      return status.id() == id && status.phase() != job::JOB_RUNNING;
    });
  };
  ASSERT_TRUE(ask(7, image::VISION_CALIBRATE, ""));
  EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  EXPECT_NEAR(status.scale(), 1.29e-5, 2e-4 * 1.29e-5);
  EXPECT_TRUE(std::filesystem::exists(folder / "camera.yaml"));

  ASSERT_TRUE(ask(8, image::VISION_MEASURE, (folder / "seen.png").string()));
  EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard lock{mutex};
    return droplets && droplets->request() == 8;
  }));
  EXPECT_TRUE(std::filesystem::exists(folder / "seen.png"));
  ASSERT_EQ(droplets->droplets().size(), 3U);
  for (const auto& [x, y, radius] :
       {std::array{-2.0e-3, 1.0e-3, 4.0e-4}, std::array{-1.2e-3, -1.0e-3, 5.0e-4},
        std::array{2.2e-3, -0.5e-3, 6.0e-4}}) {
    double nearest = 1.0;
    for (const auto& droplet : droplets->droplets())
      nearest = std::min(nearest, std::hypot(droplet.position()[0] - x, droplet.position()[1] - y) +
                                      std::abs(0.5 * droplet.diameter() - radius));
    EXPECT_LT(nearest, 0.1 * 1.29e-5);
  }
}

}  // namespace
}  // namespace invar::vision

int main(int argc, char** argv) {
  if (argc == 4 && std::string{argv[1]} == "--serve")
    return invar::vision::serve(argv[2], static_cast<std::uint32_t>(std::stoul(argv[3])));
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
