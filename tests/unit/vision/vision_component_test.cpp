#include "components/vision/vision_component.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

#include "components/vision/simulated_camera.hpp"
#include "core/vision/camera_file.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::vision {
namespace {

using ::testing::HasSubstr;

/// A camera, vision and what stands about them, joined by their ports; steps of 10 ms.
struct Bench final : Component {
  Output<sensing::ToolPosition> tool{*this, "tool"};
  Output<stage::AxisState> state_x{*this, "state_x"}, state_y{*this, "state_y"};
  Output<dispensing::LandedDroplet> landed{*this, "landed", "event"};
  Output<dispensing::SubstrateState> substrate{*this, "substrate", "state"};
  Output<image::VisionCommand> command{*this, "command", "command"};
  Output<image::Frame> forged{*this, "forged", "image"};
  Input<image::Frame> frame{*this, "frame"};
  Input<image::DropletsMeasured> droplets{*this, "droplets"};
  Input<image::VisionStatus> status{*this, "status"};
  FrameCamera& camera;
  Vision& vision;
  std::uint64_t cycle = 0;
  bool camera_runs = true;

  Bench(FrameCamera& the_camera, Vision& the_vision) : camera{the_camera}, vision{the_vision} {
    camera.simulated_time = vision.simulated_time = true;
    for (OutputPort* port : {static_cast<OutputPort*>(&tool), static_cast<OutputPort*>(&state_x),
                             static_cast<OutputPort*>(&state_y), static_cast<OutputPort*>(&landed),
                             static_cast<OutputPort*>(&substrate)})
      if (auto* input = camera.find_port(port->name())) port->connect(*static_cast<InputPort*>(input));
    join(vision, "expose", camera, "expose");
    join(camera, "frame", vision, "frame");
    static_cast<OutputPort*>(camera.find_port("frame"))->connect(frame);
    static_cast<OutputPort*>(vision.find_port("droplets"))->connect(droplets);
    static_cast<OutputPort*>(vision.find_port("status"))->connect(status);
    command.connect(*static_cast<InputPort*>(vision.find_port("command")));
    forged.connect(*static_cast<InputPort*>(vision.find_port("frame")));
    camera.configure();
    vision.configure();
    camera.activate();
    vision.activate();
  }
  static void join(Component& from, const char* output, Component& to, const char* input) {
    static_cast<OutputPort*>(from.find_port(output))->connect(*static_cast<InputPort*>(to.find_port(input)));
  }
  void step(const Tick&) noexcept override {}

  /// The tool truly stands at `at`; the encoders say so plus `error`, and the servo knows `correction` of it.
  void stand(double x, double y, double error = 0.0, double correction = 0.0) {
    sensing::ToolPosition position;
    position.position() = {x, y, 0.0};
    tool.write(position);
    stage::AxisState state;
    state.at().time_ns(static_cast<std::int64_t>(cycle) * 10'000'000);
    state.position(x + error);
    state.correction(correction);
    state_x.write(state);
    state.position(y);
    state.correction(0.0);
    state_y.write(state);
  }
  void drop(double x, double y, double diameter, std::uint64_t number = 1, bool satellite = false) {
    dispensing::LandedDroplet droplet;
    droplet.substrate(number);
    droplet.satellite(satellite);
    droplet.position() = {x, y};
    droplet.diameter(diameter);
    landed.write(droplet);
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i, ++cycle) {
      const Tick tick{Instant{static_cast<std::int64_t>(cycle) * 10'000'000}, 0.01, cycle};
      camera.set_now(tick.now);
      vision.set_now(tick.now);
      if (camera_runs) camera.step(tick);
      vision.step(tick);
    }
  }
  void ask(std::uint64_t number, image::VisionTask task = image::VISION_MEASURE,
           const std::string& picture = "", const std::vector<std::array<double, 2>>& targets = {}) {
    image::VisionCommand request;
    request.id(number);
    request.wanted(task);
    request.picture_path(picture);
    for (const auto& target : targets) {
      image::SubstratePoint point;
      point.position(target);
      request.targets().push_back(point);
    }
    command.write(request);
    run(4);
  }
  std::string said() { return status.latest()->text().c_str(); }
};

SimulatedCamera::Parameters camera_parameters() {
  SimulatedCamera::Parameters p;
  p.width = 600;
  p.height = 400;
  return p;
}

/// A camera.yaml that fits camera_parameters().
std::filesystem::path sound_camera(const invar::testing::TemporaryFolder& folder) {
  CameraModel camera;
  camera.scale = 1.29e-5;
  camera.scale_sigma = 1e-9;
  camera.width = 600;
  camera.height = 400;
  camera.center = {299.5, 199.5};
  return folder.write("camera.yaml", camera_yaml(camera));
}

/// A simulated camera and vision in a bench; a calibrated camera unless the caller asks otherwise.
struct Sight {
  invar::testing::TemporaryFolder folder;
  SimulatedCamera::Parameters seeing = camera_parameters();
  Vision::Parameters measuring;
  SimulatedCamera camera;
  Vision vision;
  Bench bench{camera, vision};
  explicit Sight(const std::function<void(Sight&)>& change = [](Sight&) {})
      : camera{(measuring.camera = sound_camera(folder), change(*this), seeing)}, vision{measuring} {}
};

// The same sight through a pinhole camera whose plane is 0.1 m away: 0.1 / 7751.938 is the 12.9 um/px of the simulated one.
TEST(Vision, ReadsAPinholeCamera) {
  Sight sight{[](Sight& s) {
    metrology::PinholeCamera pinhole{7751.938, 7751.938, 299.5, 199.5, 0.0, {}, {}}, sigma;
    sigma.fx = 1.0;
    s.measuring.camera = s.folder.write("pinhole.yaml", camera_yaml(pinhole, sigma, "pinhole", std::nullopt));
    EXPECT_THAT([&] { (void)read_camera(s.measuring.camera); },
                ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("plane")));
    s.measuring.distance = 0.1;
  }};
  Bench& bench = sight.bench;
  const std::vector<std::array<double, 2>> truth{{0.1, 0.1}, {0.1015, 0.1012}, {0.0985, 0.0991}};
  for (const auto& at : truth) bench.drop(at[0], at[1], 6e-4);
  bench.stand(0.1, 0.1, 0.0, 0.0);
  bench.ask(1);
  const auto* seen = bench.droplets.latest();
  ASSERT_NE(seen, nullptr) << bench.said();
  ASSERT_EQ(seen->droplets().size(), truth.size());
  for (const auto& droplet : seen->droplets()) {
    double nearest = 1.0;
    for (const auto& at : truth)
      nearest = std::min(nearest, std::hypot(at[0] - droplet.position()[0], at[1] - droplet.position()[1]));
    EXPECT_LT(nearest, 0.1 * 1.29e-5);
    EXPECT_NEAR(droplet.diameter(), 6e-4, 2e-6);
  }
  EXPECT_NEAR(bench.status.latest()->scale(), 1.29e-5, 1e-10);
}

TEST(Vision, FindsDropletsWhereTheyLieOnTheSubstrate) {
  Sight sight{[](Sight& s) {
    s.seeing.mount.offset = {0.031, -0.012};
    s.seeing.mount.rotation = 0.02;
    s.seeing.dust = 10;
    s.seeing.look.light_slope_x = 0.2;
    s.measuring.mount = s.seeing.mount;
  }};
  Bench& bench = sight.bench;

  const std::vector<std::array<double, 2>> truth{
      {0.131, 0.088}, {0.1325, 0.0895}, {0.129, 0.0868}, {0.1332, 0.0871}};
  for (const auto& at : truth) bench.drop(at[0], at[1], 6e-4);
  bench.drop(0.1301, 0.0882, 1.2e-4, 1, true);
  bench.stand(0.1, 0.1, 3e-6, 3e-6);  // the servo corrects the encoder's error: nothing of it must remain
  bench.ask(1);

  const auto* seen = bench.droplets.latest();
  ASSERT_NE(seen, nullptr) << bench.said();
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_DONE);
  EXPECT_EQ(seen->request(), 1U);
  std::size_t sound = 0;
  for (const auto& droplet : seen->droplets()) {
    if (droplet.status() != image::DROPLET_SOUND) continue;
    double nearest = 1.0;
    for (const auto& at : truth)
      nearest = std::min(nearest, std::hypot(at[0] - droplet.position()[0], at[1] - droplet.position()[1]));
    EXPECT_LT(nearest, 0.05 * 1.29e-5);
    EXPECT_LT(droplet.position_sigma(), 0.05 * 1.29e-5);
    EXPECT_GT(droplet.position_sigma(), 0.0);
    EXPECT_NEAR(droplet.diameter(), 6e-4, 2e-6);
    ++sound;
  }
  EXPECT_EQ(sound, truth.size());
  EXPECT_NEAR(bench.status.latest()->view_size()[0], 600 * 1.29e-5, 0.1 * 600 * 1.29e-5);
  EXPECT_EQ(bench.status.latest()->view_center()[0], 0.031);
}

TEST(Vision, AnUncorrectedEncoderShiftsWhatItSees) {
  Sight sight;
  Bench& bench = sight.bench;
  bench.drop(0.05, 0.05, 6e-4);
  bench.stand(0.05, 0.05, 4e-6);
  bench.ask(1);
  ASSERT_EQ(bench.droplets.latest()->droplets().size(), 1U);
  EXPECT_NEAR(bench.droplets.latest()->droplets()[0].position()[0], 0.05 + 4e-6, 5e-7);
}

TEST(Vision, AFreshSubstrateIsSeenEmpty) {
  Sight sight;
  Bench& bench = sight.bench;
  bench.stand(0.05, 0.05);
  bench.drop(0.05, 0.05, 6e-4);
  bench.ask(1);
  EXPECT_EQ(bench.droplets.latest()->droplets().size(), 1U);
  dispensing::SubstrateState fresh;
  fresh.number(2);
  bench.substrate.write(fresh);
  bench.ask(2);
  EXPECT_EQ(bench.droplets.latest()->request(), 2U);
  EXPECT_EQ(bench.droplets.latest()->droplets().size(), 0U);
  bench.drop(0.0505, 0.05, 6e-4, 1);  // late, from the one before
  bench.drop(0.0495, 0.05, 6e-4, 2);
  bench.ask(3);
  ASSERT_EQ(bench.droplets.latest()->droplets().size(), 1U);
  EXPECT_NEAR(bench.droplets.latest()->droplets()[0].position()[0], 0.0495, 1e-6);
}

constexpr const char* ruler_text =
    "circles:\n  - {radius: 2.5e-4, at: [-2.0e-3, 1.0e-3]}\n  - {radius: 5.0e-4, at: [-1.2e-3, -1.0e-3]}\n"
    "  - {radius: 7.5e-4, at: [0.3e-3, 0.9e-3]}\n  - {radius: 10.0e-4, at: [2.2e-3, -0.5e-3]}\n";

TEST(Vision, CalibratesByARulerOnTheTable) {
  Sight sight{[](Sight& s) {
    s.seeing.width = 1200;
    s.seeing.height = 800;
    s.seeing.scale = 1.1173e-5;
    SimulatedCamera::Ruler ruler;
    ruler.file = s.folder.write("ruler.yaml", ruler_text);
    ruler.position = {0.18, 0.02};
    s.seeing.ruler = ruler;
    s.measuring.camera.clear();
    s.measuring.ruler = ruler.file;
    s.measuring.out = (s.folder / "out").string();
  }};
  Bench& bench = sight.bench;
  const auto& folder = sight.folder;
  bench.run(1);
  EXPECT_EQ(bench.status.latest()->text(), "not calibrated");
  bench.ask(1);
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_FAILED);
  EXPECT_THAT(bench.said(), HasSubstr("not calibrated"));

  bench.stand(0.1, 0.1);  // the ruler is not there
  bench.ask(2, image::VISION_CALIBRATE);
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_FAILED);
  EXPECT_THAT(bench.said(), HasSubstr("0 circles, the ruler has 4"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out" / "camera.yaml"));

  bench.stand(0.18, 0.02);
  bench.ask(3, image::VISION_CALIBRATE, (folder / "ruler.png").string());
  ASSERT_EQ(bench.status.latest()->phase(), job::JOB_DONE) << bench.said();
  EXPECT_NEAR(bench.status.latest()->scale(), sight.seeing.scale, 2e-4 * sight.seeing.scale);
  EXPECT_NEAR(read_camera(folder / "out" / "camera.yaml").scale, bench.status.latest()->scale(), 1e-14);
  EXPECT_EQ(cv::imread(folder / "ruler.png").cols, 1200);

  bench.stand(0.05, 0.05);
  bench.drop(0.0512, 0.0493, 6e-4);
  bench.ask(4);
  ASSERT_EQ(bench.droplets.latest()->droplets().size(), 1U);
  EXPECT_NEAR(bench.droplets.latest()->droplets()[0].position()[0], 0.0512, 6e-7);
  EXPECT_NEAR(bench.droplets.latest()->droplets()[0].position()[1], 0.0493, 6e-7);
}

TEST(Vision, DrawsOutlinesAndTargets) {
  Sight sight;
  Bench& bench = sight.bench;
  bench.stand(0.05, 0.05);
  bench.drop(0.05, 0.05, 6e-4);
  const auto file = sight.folder / "pictures" / "seen.png";
  bench.ask(1, image::VISION_MEASURE, file.string(), {{0.0505, 0.05}});
  const cv::Mat picture = cv::imread(file, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(picture.cols, 600);
  const auto coloured = [&](double x, double y) {
    const cv::Vec3b p =
        picture.at<cv::Vec3b>(static_cast<int>(std::lround(y)), static_cast<int>(std::lround(x)));
    return p[0] != p[1] || p[1] != p[2];
  };
  EXPECT_TRUE(coloured(299.5 - 0.707 * 3e-4 / 1.29e-5, 199.5 - 0.707 * 3e-4 / 1.29e-5));  // the outline
  EXPECT_TRUE(coloured(299.5 + 5e-4 / 1.29e-5 + 4.0, 199.5));                             // the target's ring
  EXPECT_FALSE(coloured(100, 100));
}

TEST(Vision, AsksAgainForAFrameThatWasLostAndGivesUpInTheEnd) {
  Sight sight{[](Sight& s) { s.measuring.patience = 0.1; }};
  Bench& bench = sight.bench;
  bench.camera_runs = false;
  bench.ask(1);
  image::ExposeCommand lost;  // what the camera was asked for first never arrives there
  while (static_cast<Inbox<image::ExposeCommand>*>(sight.camera.find_port("expose"))->take(lost)) {
  }
  bench.camera_runs = true;
  bench.run(20);
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_DONE) << bench.said();
  bench.camera_runs = false;
  bench.ask(2);
  bench.run(40);
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_FAILED);
  EXPECT_THAT(bench.said(), HasSubstr("no frame came in 3 attempts"));
}

TEST(Vision, CountsFramesThatAreMissing) {
  Sight sight{[](Sight& s) { s.seeing.camera.rate = 100.0; }};
  Bench& bench = sight.bench;
  bench.run(3);
  for (int i = 0; i < 4; ++i) {  // vision is late: the newest of these is taken
    const Tick tick{Instant{static_cast<std::int64_t>(bench.cycle) * 10'000'000}, 0.01, bench.cycle};
    sight.camera.step(tick);
    ++bench.cycle;
  }
  bench.run(1);
  EXPECT_EQ(bench.status.latest()->frames_received(), 4U);
  EXPECT_EQ(bench.status.latest()->frames_dropped(), 4U);
  EXPECT_EQ(bench.status.latest()->frames_measured(), 4U);
  EXPECT_EQ(bench.droplets.latest()->frame_number(), 8U);
}

TEST(Vision, RefusesFramesThatCannotBe) {
  Sight sight;
  Bench& bench = sight.bench;
  image::Frame frame;
  frame.number(1);
  frame.width(600);
  frame.height(400);
  frame.pixels().resize(100);
  bench.forged.write(frame);
  bench.run(1);
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_FAILED);
  EXPECT_THAT(bench.said(), HasSubstr("does not fit its pixels"));
  frame.number(2);
  frame.width(64);
  frame.height(64);
  frame.pixels().resize(64 * 64);
  bench.forged.write(frame);
  bench.run(1);
  EXPECT_THAT(bench.said(), HasSubstr("frames of 64 x 64 px, but the camera was calibrated with 600 x 400"));
  EXPECT_EQ(bench.droplets.latest(), nullptr);
  bench.ask(5);  // and a sound one is taken again
  EXPECT_EQ(bench.status.latest()->phase(), job::JOB_DONE) << bench.said();
}

TEST(Vision, TwoRunsAreEqualBitForBit) {
  const auto run = [&] {
    Sight sight{[](Sight& s) {
      s.seeing.dust = 20;
      s.seeing.look.clutter = 3.0;
    }};
    Bench& bench = sight.bench;
    bench.stand(0.05, 0.05);
    bench.drop(0.0503, 0.0501, 6e-4);
    bench.ask(1);
    std::vector<double> all{bench.droplets.latest()->droplets()[0].position()[0],
                            bench.droplets.latest()->droplets()[0].position()[1],
                            static_cast<double>(bench.droplets.latest()->latency_ns())};
    for (const std::uint8_t pixel : bench.frame.latest()->pixels()) all.push_back(pixel);
    return all;
  };
  EXPECT_EQ(run(), run());
}

TEST(Vision, KnowsItsInputsBeforeItRuns) {
  const invar::testing::TemporaryFolder folder;
  Vision::Parameters p;
  EXPECT_THAT(invar::testing::fault_of([&] { Vision{p}; }), HasSubstr("camera: missing, and no `ruler`"));
  p.camera = sound_camera(folder);
  p.polarity = "bright";
  EXPECT_THAT(invar::testing::fault_of([&] { Vision{p}; }), HasSubstr("polarity: is `bright`"));
  p.polarity = "auto";
  std::ifstream in{p.camera};
  std::string text{std::istreambuf_iterator<char>{in}, {}};
  text.replace(text.find("1.29e-05"), 8, "1.30e-05");
  p.camera = folder.write("edited.yaml", text);
  EXPECT_THAT(invar::testing::fault_of([&] { Vision{p}; }),
              HasSubstr("edited.yaml: its checksum does not fit its text"));
  p.camera = folder.write("cut.yaml", text.substr(0, text.find("scale:") + 12));
  EXPECT_THAT(invar::testing::fault_of([&] { Vision{p}; }), HasSubstr("cut.yaml"));
}

}  // namespace
}  // namespace invar::vision
