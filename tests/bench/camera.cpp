// From the middle of an exposure to the measured droplets in another process: a camera, vision and a 1 kHz loop, each a
// process of its own; frames flow in every other turn of 2 s, so that the loop's wake-up shows with and without them.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <thread>
#include <vector>

#include "components/vision/frame_camera.hpp"
#include "components/vision/vision_component.hpp"
#include "core/dds/node.hpp"
#include "core/executor/executor.hpp"
#include "core/vision/camera_file.hpp"
#include "core/vision/library.hpp"
#include "tests/unit/vision/scenes.hpp"

extern char** environ;

namespace invar {
namespace {

struct Settings {
  double seconds = 40.0;
  double rate = 30.0;  // frames a second
  std::int64_t recipe = 1;
  std::string role;
  std::int64_t start_ns = 0;
  bool udp = false;
};

constexpr std::int64_t turn_ns = 2'000'000'000;

bool frames_flow(const Settings& s, std::int64_t now) {
  const std::int64_t since = now - s.start_ns;
  return since >= 0 && since < static_cast<std::int64_t>(s.seconds * 1e9) && since / turn_ns % 2 == 0;
}

dds::NodeOptions options(const Settings& s, const std::string& process) {
  dds::NodeOptions o;
  o.cell = "bench";
  o.process = process;
  o.domain = 12;
  o.addresses = {"127.0.0.1"};
  o.shared_memory = !s.udp;
  return o;
}

/// One picture, ready beforehand, over and over: what is measured is the way, not the rendering.
class StillCamera final : public vision::FrameCamera {
 public:
  StillCamera(const Settings& s, const vision::CameraParameters& parameters)
      : FrameCamera{parameters}, settings_{s} {
    const auto recipes = vision::testing::recipes();
    picture_ = vision::library().render(
        vision::testing::make_scene(recipes.at(static_cast<std::size_t>(s.recipe)), 1).scene);
  }

 private:
  bool take_picture(const Tick&, std::uint64_t, Picture& picture) override {
    picture.at = utc_now();
    picture.pixels = picture_;
    return frames_flow(settings_, monotonic_now().ns);
  }
  const Settings& settings_;
  vision::Pixels picture_;
};

/// A process with one component, stepped `rate` times a second by the usual scheduling.
int run_component(const Settings& s, std::unique_ptr<Component> component, const std::string& process,
                  double rate) {
  dds::Node node{options(s, process), dds::standard_profiles()};
  ExecutorOptions worker;
  worker.process = process;
  worker.period = Duration::seconds(1.0 / rate);
  Executor executor{worker};
  component->name = process;
  for (Port* port : component->ports()) {
    port->topic = "cell/bench/" + port->name();
    if (port->direction() == Port::Direction::output)
      node.bind(static_cast<OutputPort&>(*port), {});
    else
      node.bind(static_cast<InputPort&>(*port));
  }
  executor.add(std::move(component));
  executor.start();
  node.start();
  for (const Transition transition : {Transition::configure, Transition::activate})
    if (const Outcome outcome = executor.transition(0, transition); !outcome.ok()) {
      std::cerr << process << ": " << outcome.reason << '\n';
      return 1;
    }
  while (monotonic_now().ns < s.start_ns + static_cast<std::int64_t>(s.seconds * 1e9))
    std::this_thread::sleep_for(std::chrono::milliseconds{20});
  executor.stop();
  node.stop();
  return 0;
}

int be_camera(const Settings& s) {
  vision::CameraParameters parameters;
  parameters.rate = s.rate;
  return run_component(s, std::make_unique<StillCamera>(s, parameters), "camera", 500.0);
}

int be_vision(const Settings& s) {
  cv::setNumThreads(1);
  const auto file =
      std::filesystem::temp_directory_path() / ("invar-bench-camera-" + std::to_string(getpid()) + ".yaml");
  vision::CameraModel camera;
  camera.scale = 1.29e-5;
  std::ofstream{file} << vision::camera_yaml(camera);
  vision::Vision::Parameters parameters;
  parameters.camera = file;
  const int status = run_component(s, std::make_unique<vision::Vision>(parameters), "vision", 500.0);
  std::filesystem::remove(file);
  return status;
}

double percentile(std::vector<std::int64_t> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return static_cast<double>(
      values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))]);
}

struct Idle final : Component {
  void step(const Tick&) noexcept override {}
};

pid_t start_role(const Settings& s, const std::string& role) {
  std::vector<std::string> words{"bench_camera",
                                 "--role",
                                 role,
                                 "--start",
                                 std::to_string(s.start_ns),
                                 "--seconds",
                                 std::to_string(s.seconds),
                                 "--rate",
                                 std::to_string(s.rate),
                                 "--recipe",
                                 std::to_string(s.recipe)};
  if (s.udp) words.emplace_back("--udp");
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t pid = 0;
  if (posix_spawn(&pid, "/proc/self/exe", nullptr, nullptr, arguments.data(), environ) != 0) return 0;
  return pid;
}

int be_loop(Settings s) {
  s.start_ns = (monotonic_now().ns / 1'000'000'000 + 4) * 1'000'000'000;  // time to find each other
  const pid_t camera = start_role(s, "camera"), eye = start_role(s, "vision");
  if (camera == 0 || eye == 0) return 1;

  ExecutorOptions loop;
  loop.process = "loop";
  loop.real_time =
      RealTimeRequest{.priority = 80, .cpu = std::nullopt, .lock_memory = true, .require = false};
  Executor executor{loop};
  executor.add(std::make_unique<Idle>());
  executor.start();

  std::mutex mutex;
  std::vector<std::int64_t> measured, received;
  std::atomic<std::uint64_t> drops{0};
  dds::Node node{options(s, "loop"), dds::standard_profiles()};
  const auto reader = node.reader<image::DropletsMeasured>(
      "cell/bench/droplets", "event", [&](const image::DropletsMeasured& frame) {
        const std::int64_t took = utc_now().ns - frame.at().time_ns();
        const std::lock_guard lock{mutex};
        measured.push_back(frame.latency_ns());
        received.push_back(took);
        drops += frame.droplets().size();
      });
  std::array<std::vector<std::int64_t>, 2> p50, p99;
  const auto turns = static_cast<std::int64_t>(s.seconds * 1e9) / turn_ns;
  for (std::int64_t turn = 0; turn < turns; ++turn) {
    const auto until = [&](std::int64_t time) {
      std::this_thread::sleep_for(
          std::chrono::nanoseconds{std::max<std::int64_t>(0, time - monotonic_now().ns)});
    };
    until(s.start_ns + turn * turn_ns + 100'000'000);
    executor.clear_histograms();
    until(s.start_ns + (turn + 1) * turn_ns - 100'000'000);
    const HistogramCopy wake_up = executor.wake_up();
    p50[static_cast<std::size_t>(turn % 2)].push_back(wake_up.quantile(0.5).ns);
    p99[static_cast<std::size_t>(turn % 2)].push_back(wake_up.quantile(0.99).ns);
  }
  int status = 0, other = 0;
  waitpid(camera, &status, 0);
  waitpid(eye, &other, 0);
  executor.stop();

  const std::lock_guard lock{mutex};
  const double frames = s.rate * s.seconds / 2.0;
  std::cout << std::fixed << std::setprecision(2) << "| | frames | p50 ms | p99 ms | max ms |\n"
            << "| --- | --- | --- | --- | --- |\n";
  for (const auto& [name, values] : {std::pair{"exposure to measured", &measured},
                                     std::pair{"exposure to droplets in a third process", &received}})
    std::cout << "| " << name << " | " << values->size() << " of " << static_cast<std::int64_t>(frames)
              << " | " << percentile(*values, 0.5) * 1e-6 << " | " << percentile(*values, 0.99) * 1e-6
              << " | " << percentile(*values, 1.0) * 1e-6 << " |\n";
  std::cout << "\n| wake-up of the 1 kHz loop, median of turns | p50 us | p99 us |\n| --- | --- | --- |\n"
            << std::setprecision(1);
  for (const std::size_t with : {0U, 1U})
    std::cout << "| " << (with == 0 ? "with frames" : "without") << " | " << percentile(p50[with], 0.5) * 1e-3
              << " | " << percentile(p99[with], 0.5) * 1e-3 << " |\n";
  std::cout << "\n" << drops << " droplets in all.\n";
  return status == 0 && other == 0 && !received.empty() ? 0 : 1;
}

}  // namespace

int bench(int argc, char** argv) {
  Settings s;
  CLI::App program{
      "Latency from camera to measured droplets over DDS, and what the loop beside notices of it."};
  program.add_option("--seconds", s.seconds, "length of the run")->capture_default_str();
  program.add_option("--rate", s.rate, "frames a second of 1200 x 800 px")->capture_default_str();
  program.add_option("--recipe", s.recipe, "which scene of bench_droplets")->capture_default_str();
  program.add_flag("--udp", s.udp, "without shared memory");
  program.add_option("--role", s.role)->group("");
  program.add_option("--start", s.start_ns)->group("");
  CLI11_PARSE(program, argc, argv);
  return s.role == "camera" ? be_camera(s) : s.role == "vision" ? be_vision(s) : be_loop(s);
}

}  // namespace invar

int main(int argc, char** argv) { return invar::bench(argc, argv); }
