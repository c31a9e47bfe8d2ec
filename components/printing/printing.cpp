#include "components/printing/printing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "core/compensation/trajectory_file.hpp"
#include "core/job/deliver.hpp"
#include "core/recording/table.hpp"

namespace invar::printing {

using namespace dispensing;
using metrology::TrajectoryFit;

namespace {

constexpr std::size_t most_droplets = 4096;

std::string in_mm(double metres) {
  char text[32];
  std::snprintf(text, sizeof text, "%g mm", 1e3 * metres);
  return text;
}

std::string picture_of(const std::filesystem::path& folder, const char* when, double height) {
  char text[48];
  std::snprintf(text, sizeof text, "%s_%gmm.png", when, 1e3 * height);
  return (folder / text).string();
}

/// Way to reach a velocity from rest within acceleration and jerk [m].
double run_up(const PrintJob& job) {
  const double plateau = job.velocity * job.jerk > job.acceleration * job.acceleration;
  const double time = plateau != 0.0 ? job.velocity / job.acceleration + job.acceleration / job.jerk
                                     : 2.0 * std::sqrt(job.velocity / job.jerk);
  return 0.5 * job.velocity * time;
}

/// Points that lie on one line in the direction of printing; at least one each.
std::vector<std::vector<Eigen::Vector2d>> rows_of(const TriggerPattern& pattern) {
  std::vector<std::vector<Eigen::Vector2d>> rows;
  for (const TriggerPoint& point : pattern.points()) {
    const Eigen::Vector2d at{point.position()[0], point.position()[1]};
    bool goes_on = false;
    if (!rows.empty() && rows.back().size() == 1) goes_on = (at - rows.back().back()).norm() > 0.0;
    if (!rows.empty() && rows.back().size() > 1) {
      const auto& row = rows.back();
      const Eigen::Vector2d along = (row.back() - row[row.size() - 2]).normalized();
      goes_on = along.dot((at - row.back()).normalized()) > 1.0 - 1e-6;
    }
    if (!goes_on) rows.emplace_back();
    rows.back().push_back(at);
  }
  return rows;
}

}  // namespace

Printing::Printing(Component& owner, job::JobHost& host)
    : owner_{owner},
      host_{host},
      pressure_command_{owner, "pressure_command", "command"},
      pressure_{owner, "pressure", {.profile = "state"}},
      print_{owner, "print", "command"},
      pattern_{owner, "pattern", {.profile = "command"}, 4},
      trigger_{owner, "trigger", "command"},
      valve_{owner, "valve", {.profile = "state"}},
      jetted_{owner, "jetted", {.profile = "event"}, most_droplets},
      refused_{owner, "refused", {.profile = "event"}, most_droplets},
      lay_{owner, "lay", "command"},
      substrate_{owner, "substrate", {.profile = "state"}},
      aim_{owner, "aim", "command"},
      aim_status_{owner, "aim_status", {.profile = "state"}},
      look_{owner, "look", "command"},
      vision_{owner, "vision", {.profile = "state"}},
      droplets_{owner, "droplets", {.profile = "event"}, 64} {}

template <class Sample>
Sample Printing::stamped() const {
  Sample sample;
  owner_.stamp(sample);
  return sample;
}

job::Task Printing::wait_for(const Condition& done, double seconds, std::string what) {
  const Instant give_up = owner_.now() + Duration::seconds(seconds);
  while (!done()) {
    if (owner_.now() > give_up) throw std::runtime_error{what};
    co_await job::NextStep{};
  }
}

void Printing::trigger(TriggerCommandKind kind, std::uint64_t pattern_id) {
  auto command = stamped<TriggerCommand>();
  command.id(last_command_ = host_.next_id());
  command.kind(kind);
  command.pattern_id(pattern_id);
  trigger_.write(command);
}

void Printing::make_safe() {
  trigger(TRIGGER_DISARM, 0);
  auto off = stamped<PressureCommand>();
  off.id(host_.next_id());
  pressure_command_.write(off);
}

job::Task Printing::pressurise() {
  const Condition heard = [this] { return pressure_.latest() != nullptr; };
  co_await wait_for(heard, 10.0, "the dispenser says nothing: is it active?");
  auto on = stamped<PressureCommand>();
  on.id(host_.next_id());
  on.enabled(true);
  pressure_command_.write(on);
  const Condition steady = [this] { return pressure_.latest()->in_band() && !pressure_.latest()->stale(); };
  co_await wait_for(steady, 20.0, "the pressure does not reach its band: look at the supply and the alarms");
}

job::Task Printing::change_model(compensation::ModelCommandKind kind, std::string path) {
  auto command = stamped<compensation::ModelCommand>();
  command.id(last_command_ = host_.next_id());
  command.kind(kind);
  command.path(path);
  aim_.write(command);
  const Condition answered = [this] {
    return aim_status_.latest() != nullptr && aim_status_.latest()->command_id() == last_command_;
  };
  co_await wait_for(answered, 5.0, "the dispenser does not answer to its model");
  if (aim_status_.latest()->state() == compensation::MODEL_REFUSED)
    throw std::runtime_error{std::string{"the dispenser refused the model: "} +
                             aim_status_.latest()->text().c_str()};
}

job::Task Printing::use(const metrology::DropletTrajectory& trajectory, std::filesystem::path source,
                        std::filesystem::path file) {
  compensation::ModelText text{"dispenser", {source}};
  compensation::write_trajectory(text, trajectory);
  text.write(file);
  std::string path;
  co_await job::deliver(owner_, aim_, file, path);
  co_await change_model(compensation::MODEL_STAGE, path);
  co_await change_model(compensation::MODEL_ACTIVATE, path);
}

/// One picture with everything on it that vision found; its answer is in the inbox afterwards.
job::Task Printing::calibrate_camera(Eigen::Vector2d ruler) {
  host_.tell("calibrating the camera", progress_);
  const Condition seen = [this] { return vision_.latest() != nullptr; };
  co_await wait_for(seen, 10.0, "vision says nothing: is it active?");
  const auto& center = vision_.latest()->view_center();
  co_await host_.move_to({ruler.x() - center[0], ruler.y() - center[1], 0.0}, {});
  auto command = stamped<image::VisionCommand>();
  command.id(last_command_ = host_.next_id());
  command.wanted(image::VISION_CALIBRATE);
  look_.write(command);
  const Condition ended = [this] {
    const auto* status = vision_.latest();
    return status->id() == last_command_ && status->phase() != job::JOB_RUNNING &&
           status->phase() != job::JOB_IDLE;
  };
  co_await wait_for(ended, 20.0, "vision does not calibrate the camera: no frame?");
  if (vision_.latest()->phase() != job::JOB_DONE)
    throw std::runtime_error{std::string{"the camera is not calibrated: "} +
                             vision_.latest()->text().c_str()};
}

/// Each row with a run-up, at the job's velocity, one after the other.
job::Task Printing::drive_rows(const PrintJob& job, const TriggerPattern& pattern) {
  const job::Pace pace{job.velocity, job.acceleration, job.jerk};
  const double lead = static_cast<double>(pattern.points().front().lead_ns()) * 1e-9;
  const double before = 1.2 * run_up(job) + job.velocity * std::max(lead, 0.0) + 2e-4;
  const double after = 1.2 * run_up(job) + job.velocity * std::max(-lead, 0.0) + 2e-4;
  for (const auto& row : rows_of(pattern)) {
    const Eigen::Vector2d along =
        row.size() > 1 ? Eigen::Vector2d{(row.back() - row.front()).normalized()} : Eigen::Vector2d{1.0, 0.0};
    const Eigen::Vector2d from = row.front() - before * along;
    const Eigen::Vector2d to = row.back() + after * along;
    co_await host_.move_to({from.x(), from.y(), 0.0}, {});
    co_await host_.move_to({to.x(), to.y(), 0.0}, pace);
  }
}

/// Appends what was printed and seen; droplets that vision did not find are left out.
job::Task Printing::print(const PrintJob& job, double height, std::string picture, Prints& prints) {
  auto fresh = stamped<SubstrateCommand>();
  fresh.id(last_command_ = host_.next_id());
  fresh.height(height);
  lay_.write(fresh);
  const Condition laid = [this] {
    return substrate_.latest() != nullptr && substrate_.latest()->command_id() == last_command_;
  };
  co_await wait_for(laid, 600.0, "no fresh substrate came");

  auto wanted = stamped<PatternCommand>();
  wanted.id(last_command_ = host_.next_id());
  wanted.name(job.pattern);
  wanted.height(height);
  print_.write(wanted);
  TriggerPattern pattern;
  const Condition answered = [this, &pattern] {
    while (pattern_.take(pattern))
      if (pattern.id() == last_command_) return true;
    return false;
  };
  co_await wait_for(answered, 5.0, "the dispenser does not answer to a pattern");
  if (pattern.points().empty())
    throw std::runtime_error{std::string{"no pattern: "} + pattern.refusal().c_str()};
  const Condition loaded = [this, &pattern] {
    return valve_.latest() != nullptr && valve_.latest()->pattern_id() == pattern.id();
  };
  co_await wait_for(loaded, 5.0, "the pattern does not reach the valve");
  trigger(TRIGGER_ARM, pattern.id());
  const Condition obeyed = [this] { return valve_.latest()->command_id() == last_command_; };
  co_await wait_for(obeyed, 5.0, "the valve does not answer");

  co_await drive_rows(job, pattern);
  trigger(TRIGGER_DISARM, pattern.id());
  co_await wait_for(obeyed, 5.0, "the valve does not answer");
  const Instant landed = owner_.now() + Duration::milliseconds(100);
  const Condition settled = [this, landed] { return owner_.now() >= landed; };
  co_await wait_for(settled, 1.0, "");

  DropletRefused refused;
  std::size_t count = 0;
  std::string why;
  while (refused_.take(refused))
    if (refused.pattern_id() == pattern.id() && count++ == 0) why = refused.text().c_str();
  if (count > 0)
    throw std::runtime_error{std::to_string(count) + " of " + std::to_string(pattern.points().size()) +
                             " droplets were not jetted: " + why};
  Prints now;
  DropletJetted jetted;
  while (jetted_.take(jetted)) {
    if (jetted.pattern_id() != pattern.id()) continue;
    Print one;
    one.droplet = jetted.droplet();
    one.target << jetted.target()[0], jetted.target()[1];
    one.jetted << jetted.position()[0], jetted.position()[1];
    one.velocity << jetted.velocity()[0], jetted.velocity()[1];
    one.height = height;
    one.time = (owner_.now() - begun_).in_seconds();
    now.push_back(one);
  }
  co_await measure(job, picture, now);
  prints.insert(prints.end(), now.begin(), now.end());
  progress_ += share_;
}

/// Looks at the pattern and joins each droplet to the target that it is nearest to; the others are taken out.
job::Task Printing::measure(const PrintJob& job, std::string picture, Prints& prints) {
  Eigen::Vector2d low = prints.front().target, high = low;
  for (const Print& one : prints) {
    low = low.cwiseMin(one.target);
    high = high.cwiseMax(one.target);
  }
  const auto& center = vision_.latest()->view_center();
  const auto& size = vision_.latest()->view_size();
  const Eigen::Vector2d needed = high - low + Eigen::Vector2d::Constant(2.0 * job.reach);
  if (size[0] > 0.0 && (needed.x() > size[0] || needed.y() > size[1]))
    throw std::runtime_error{"the pattern is larger than what the camera sees (" + in_mm(size[0]) + " by " +
                             in_mm(size[1]) + "); make it smaller"};
  const Eigen::Vector2d middle = 0.5 * (low + high);
  co_await host_.move_to({middle.x() - center[0], middle.y() - center[1], 0.0}, {});

  auto command = stamped<image::VisionCommand>();
  command.id(last_command_ = host_.next_id());
  command.wanted(image::VISION_MEASURE);
  command.picture_path(picture);
  for (const Print& one : prints) {
    image::SubstratePoint target;
    target.position({one.target.x(), one.target.y()});
    command.targets().push_back(target);
    if (command.targets().size() == 1024) break;
  }
  look_.write(command);
  image::DropletsMeasured found;
  const Condition seen = [this, &found] {
    while (droplets_.take(found))
      if (found.request() == last_command_) return true;
    return false;
  };
  co_await wait_for(seen, 20.0, "vision does not answer: no frame?");

  // Nearest pairs first, each droplet and each target once.
  struct Pair {
    double distance;
    std::size_t print;
    std::size_t droplet;
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < prints.size(); ++i)
    for (std::size_t k = 0; k < found.droplets().size(); ++k) {
      const auto& droplet = found.droplets()[k];
      if (droplet.status() != image::DROPLET_SOUND) continue;
      const double distance =
          (Eigen::Vector2d{droplet.position()[0], droplet.position()[1]} - prints[i].target).norm();
      if (distance <= job.reach) pairs.push_back({distance, i, k});
    }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::vector<char> print_taken(prints.size(), 0), droplet_taken(found.droplets().size(), 0);
  Prints joined;
  for (const Pair& pair : pairs) {
    if (print_taken[pair.print] != 0 || droplet_taken[pair.droplet] != 0) continue;
    print_taken[pair.print] = droplet_taken[pair.droplet] = 1;
    const auto& droplet = found.droplets()[pair.droplet];
    prints[pair.print].landed << droplet.position()[0], droplet.position()[1];
    prints[pair.print].diameter = droplet.diameter();
  }
  for (std::size_t i = 0; i < prints.size(); ++i)
    if (print_taken[i] != 0) joined.push_back(prints[i]);
  if (joined.size() < 3)
    throw std::runtime_error{"vision found " + std::to_string(joined.size()) + " of " +
                             std::to_string(prints.size()) + " droplets near their targets"};
  prints = std::move(joined);
}

namespace {

template <class Prints>
void write_prints(const Prints& prints, const std::filesystem::path& file) {
  recording::Table table;
  const auto column = [&](const char* name, const char* unit, auto value) {
    std::vector<double> values;
    for (const auto& one : prints) values.push_back(value(one));
    table.add(name, unit, std::move(values));
  };
  column("droplet", "", [](const auto& p) { return static_cast<double>(p.droplet); });
  column("t", "s", [](const auto& p) { return p.time; });
  column("height", "m", [](const auto& p) { return p.height; });
  column("target_x", "m", [](const auto& p) { return p.target.x(); });
  column("target_y", "m", [](const auto& p) { return p.target.y(); });
  column("landed_x", "m", [](const auto& p) { return p.landed.x(); });
  column("landed_y", "m", [](const auto& p) { return p.landed.y(); });
  column("diameter", "m", [](const auto& p) { return p.diameter; });
  column("stage_velocity_x", "m/s", [](const auto& p) { return p.velocity.x(); });
  column("stage_velocity_y", "m/s", [](const auto& p) { return p.velocity.y(); });
  column("jetted_x", "m", [](const auto& p) { return p.jetted.x(); });
  column("jetted_y", "m", [](const auto& p) { return p.jetted.y(); });
  table.write(file);
}

/// From where the nozzle stood, not from the target: holds whatever model aimed it.
template <class Prints>
metrology::Droplets droplets_of(const Prints& prints) {
  const auto n = static_cast<Eigen::Index>(prints.size());
  metrology::Droplets drops{Eigen::Matrix2Xd(2, n), Eigen::Matrix2Xd(2, n), Eigen::VectorXd(n),
                            Eigen::Matrix2Xd(2, n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& one = prints[static_cast<std::size_t>(i)];
    drops.target.col(i) = one.jetted;
    drops.landed.col(i) = one.landed;
    drops.height(i) = one.height;
    drops.stage_velocity.col(i) = one.velocity;
    drops.diameter(i) = one.diameter;
  }
  return drops;
}

template <class Prints>
double error_rms(const Prints& prints) {
  double squares = 0.0;
  for (const auto& one : prints) squares += (one.landed - one.target).squaredNorm();
  return std::sqrt(squares / static_cast<double>(prints.size()));
}

}  // namespace

job::Task Printing::watch_drift(const PrintJob& job, const TrajectoryFit& fit) {
  const double height = *std::max_element(job.heights.begin(), job.heights.end());
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  metrology::TrajectoryTracker tracker{fit, {job.drift.placement, job.drift.slowness, job.drift.limit}};
  Prints all;
  const Instant calibrated = owner_.now();
  for (std::int64_t i = 0; i < job.drift.prints; ++i) {
    const Instant next = owner_.now() + Duration::seconds(job.drift.pause);
    const Condition rested = [this, next] { return owner_.now() >= next; };
    co_await wait_for(rested, job.drift.pause + 1.0, "");
    Prints prints;
    co_await print(job, height, "", prints);
    const double time = (owner_.now() - calibrated).in_seconds();
    for (const Print& one : prints)
      tracker.add(time, height, one.velocity,
                  one.landed - one.jetted - fit.trajectory.over_field(one.jetted));
    all.insert(all.end(), prints.begin(), prints.end());
    write_prints(all, folder / "drift.csv");
    if (!tracker.within_limit(height, {job.velocity, 0.0}))
      throw std::runtime_error{"the landing has drifted by " +
                               in_mm(tracker.change(height, {job.velocity, 0.0})) +
                               " since the calibration, the limit is " + in_mm(job.drift.limit) +
                               ": clean the nozzle and calibrate again"};
    co_await use(tracker.trajectory(), folder / "drift.csv", folder / "compensation_drift.yaml");
    host_.tell("print " + std::to_string(i + 1) + " after the calibration: " + in_mm(error_rms(prints)) +
                   " RMS from the targets",
               progress_);
  }
}

job::Task Printing::run(const PrintJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  begun_ = owner_.now();
  progress_ = 0.0;
  share_ = 1.0 / static_cast<double>(2 * job.heights.size() + static_cast<std::size_t>(job.drift.prints) + 1);
  co_await host_.enable_axes();
  co_await pressurise();
  if (!job.ruler.empty()) co_await calibrate_camera({job.ruler[0], job.ruler[1]});

  Prints before;
  for (const double height : job.heights) {
    host_.tell("printing from " + in_mm(height), progress_);
    co_await print(job, height, picture_of(folder, "before", height), before);
  }
  write_prints(before, folder / "droplets.csv");
  const TrajectoryFit fit = metrology::identify_trajectory(droplets_of(before));
  co_await use(fit.trajectory, folder / "droplets.csv", folder / "dispenser_compensation.yaml");

  Prints after;
  for (const double height : job.heights) {
    host_.tell("printing again from " + in_mm(height) + ", compensated", progress_);
    co_await print(job, height, picture_of(folder, "after", height), after);
  }
  write_prints(after, folder / "droplets_after.csv");
  if (error_rms(after) > error_rms(before)) {
    co_await change_model(compensation::MODEL_ROLLBACK, "");
    throw std::runtime_error{"the compensation makes the placement worse; rolled back"};
  }
  if (job.drift.prints > 0) co_await watch_drift(job, fit);
  make_safe();
}

}  // namespace invar::printing
