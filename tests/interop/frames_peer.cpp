// One end of a camera's link: frames of 1 MB by the profile `image`, and a loop's state beside them. Arguments: writer or reader, the
// address of this host, seconds, frames a second, and optionally another profile for the frames. The reader prints what came.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "core/dds/node.hpp"
#include "idl/types.hpp"

int main(int count, char** words) {
  using namespace invar;
  using Clock = std::chrono::steady_clock;
  if (count < 5) return 2;
  const bool writes = std::strcmp(words[1], "writer") == 0;
  const double seconds = std::atof(words[3]);
  const double rate = std::atof(words[4]);
  const char* profile = count > 5 ? words[5] : "image";
  dds::NodeOptions options;
  options.cell = "frames";
  options.process = words[1];
  options.domain = 43;
  options.addresses = {words[2]};
  options.shared_memory = std::getenv("INVAR_FRAMES_BY_SHARED_MEMORY") != nullptr;
  dds::Node node{options, dds::standard_profiles()};
  constexpr std::size_t pixels = 1'000'000;
  if (writes) {
    auto frames = node.writer<image::Frame>("cell/frames/camera/frame", profile);
    auto states = node.writer<stage::AxisState>("cell/frames/axis/state", "realtime");
    image::Frame frame;
    frame.pixels().resize(pixels, 7);
    stage::AxisState state;
    while (frames.connection().matched() == 0 || states.connection().matched() == 0)
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    std::this_thread::sleep_for(std::chrono::milliseconds{500});
    const auto begin = Clock::now();
    double worst = 0.0;
    for (int cycle = 0; cycle < seconds * 100; ++cycle) {
      std::this_thread::sleep_until(begin + std::chrono::milliseconds{10} * cycle);
      state.at().cycle(static_cast<std::uint32_t>(cycle));
      states.write(state);
      if (static_cast<int>(cycle * rate / 100) == static_cast<int>((cycle - 1) * rate / 100) && cycle > 0)
        continue;
      frame.number(frame.number() + 1);
      const auto before = Clock::now();
      frames.write(frame);
      worst = std::max(worst, std::chrono::duration<double>(Clock::now() - before).count());
    }
    std::printf("sent %llu frames, %.0f states, longest write %.1f ms\n",
                static_cast<unsigned long long>(frame.number()), seconds * 100, worst * 1e3);
    std::this_thread::sleep_for(std::chrono::seconds{1});
    return 0;
  }
  std::atomic<int> whole{0}, wrong{0}, states{0};
  const auto frames =
      node.reader<image::Frame>("cell/frames/camera/frame", profile, [&](const image::Frame& frame) {
        const auto& p = frame.pixels();
        ++(p.size() == pixels && p.front() == 7 && p[pixels / 2] == 7 && p.back() == 7 ? whole : wrong);
      });
  const auto loop =
      node.reader<stage::AxisState>("cell/frames/axis/state", "realtime", [&](const auto&) { ++states; });
  const auto end = Clock::now() + std::chrono::duration<double>(seconds + 30);
  while ((loop->matched() == 0 || frames->matched() == 0) && Clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  while (loop->matched() > 0 && Clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  std::printf("frames %d wrong %d states %d\n", whole.load(), wrong.load(), states.load());
  return 0;
}
