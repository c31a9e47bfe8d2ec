// No trick: names, cuts and sampling do not change what a diagnosis says; without the right term it does not make one up.
#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include "core/diagnosis/dataset/shorten.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/simulation.hpp"
#include "tests/support/mismatch/claims.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

diagnosis::Diagnosis diagnosed(const Machine& machine, const diagnosis::Options& options = {}) {
  auto data = case_of(machine);
  return diagnosis::diagnose(
      data, [](double, const std::string&) {}, options);
}

std::vector<std::string> names(const diagnosis::Diagnosis& d) {
  std::vector<std::string> all{diagnosis::name_of(d.verdict)};
  for (const auto& finding : d.findings) all.emplace_back(finding.term.info->name);
  return all;
}

/// Rows from `first` on, one in `every`.
Machine recut(Machine machine, double first, double last, std::size_t every) {
  for (auto& table : machine.recordings) {
    const std::size_t rows = table.rows();
    for (auto& column : table.columns) {
      std::vector<double> kept;
      for (auto i = static_cast<std::size_t>(first * static_cast<double>(rows));
           static_cast<double>(i) < last * static_cast<double>(rows); i += every)
        kept.push_back(column.values[i]);
      column.values = std::move(kept);
    }
  }
  return machine;
}

struct Known {
  const char *plant, *effect;
  unsigned seed;
  std::size_t rows = 0;
};
constexpr Known known[] = {{"thermal", "sensor_lag", 3},         {"error_map", "periodic_error", 5},
                           {"droplet", "lens_distortion", 4},    {"sensor", "latency", 8},
                           {"axis", "force_ripple", 3001, 4000}, {"equations", "cubic", 3}};

/// A unit and another of the same quantity: other = factor * value + offset.
struct OtherUnit {
  const char *unit, *other;
  double factor, offset;
};
constexpr OtherUnit other_units[] = {
    {"m", "um", 1e6, 0.0},     {"mm", "m", 1e-3, 0.0},      {"s", "ms", 1e3, 0.0},
    {"A", "mA", 1e3, 0.0},     {"degC", "K", 1.0, 273.15},  {"W", "kW", 1e-3, 0.0},
    {"hPa", "Pa", 1e2, 0.0},   {"Pa", "kPa", 1e-3, 0.0},    {"m/s", "mm/s", 1e3, 0.0},
    {"kg", "g", 1e3, 0.0},     {"N/A", "mN/A", 1e3, 0.0},   {"J/K", "kJ/K", 1e-3, 0.0},
    {"W/K", "mW/K", 1e3, 0.0}, {"m/px", "um/px", 1e6, 0.0}, {"N s/m", "mN s/m", 1e3, 0.0}};

const OtherUnit* other_unit(const std::string& unit) {
  const auto found = std::find_if(std::begin(other_units), std::end(other_units),
                                  [&](const OtherUnit& one) { return unit == one.unit; });
  return found == std::end(other_units) ? nullptr : found;
}

/// Every `{value, unit, sigma}` below a node.
void convert(YAML::Node node) {
  if (node.IsMap() && node["value"] && node["unit"]) {
    const auto* to = other_unit(node["unit"].as<std::string>());
    if (to == nullptr || to->offset != 0.0) return;
    for (const char* key : {"value", "sigma"})
      if (node[key]) node[key] = to->factor * node[key].as<double>();
    node["unit"] = to->other;
  } else if (node.IsMap()) {
    for (auto entry : node) convert(entry.second);
  } else if (node.IsSequence()) {
    for (auto entry : node) convert(entry);
  }
}

/// The same machine, written down in other units: columns, noise and what its user believes.
Machine in_other_units(Machine machine) {
  const auto model = model_of(machine);
  YAML::Node yaml = YAML::Load(machine.yaml);
  convert(yaml);
  for (auto entry : yaml["noise"]) {
    const auto* signal = model.signal(entry.first.as<std::string>());
    if (const auto* to = other_unit(machine.recordings.front().find(signal->column)->unit); to != nullptr)
      entry.second = to->factor * entry.second.as<double>();
  }
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << yaml;
  machine.yaml = std::string{out.c_str()} + "\n";
  for (auto& table : machine.recordings)
    for (auto& column : table.columns)
      if (const auto* to = other_unit(column.unit); to != nullptr) {
        for (double& value : column.values) value = to->factor * value + to->offset;
        column.unit = to->other;
      }
  return machine;
}

TEST(NoTrick, OtherNamesOfColumnsAndCasesChangeNothing) {
  for (const auto& k : known) {
    Trouble trouble;
    trouble.rows = k.rows;
    const auto plain = make(k.plant, k.effect, 1.0, k.seed, trouble);
    trouble.renamed = true;
    auto renamed = make(k.plant, k.effect, 1.0, k.seed, trouble);
    for (auto& table : renamed.recordings) table.file = "zzz.csv";
    ASSERT_NE(plain.yaml, renamed.yaml);
    const auto one = diagnosed(plain), other = diagnosed(renamed);
    EXPECT_THAT(names(one), ::testing::Contains(k.effect)) << k.plant;
    EXPECT_EQ(names(one), names(other)) << k.plant << ' ' << k.effect;
    for (std::size_t i = 0; i < one.findings.size(); ++i)
      EXPECT_EQ(one.findings[i].term.values, other.findings[i].term.values) << k.plant << ' ' << k.effect;
  }
}

TEST(NoTrick, OtherUnitsChangeNothing) {
  for (const auto& k : known) {
    Trouble trouble;
    trouble.rows = k.rows;
    const auto plain = make(k.plant, k.effect, 1.0, k.seed, trouble), converted = in_other_units(plain);
    ASSERT_NE(plain.recordings.front().columns.front().unit,
              converted.recordings.front().columns.front().unit);
    const auto one = diagnosed(plain), other = diagnosed(converted);
    ASSERT_EQ(names(one), names(other)) << k.plant << ' ' << k.effect;
    for (std::size_t i = 0; i < one.findings.size(); ++i)
      for (std::size_t p = 0; p < one.findings[i].sigmas.size();
           ++p)  // but for the rounding of what is written
        EXPECT_NEAR(one.findings[i].term.values[p], other.findings[i].term.values[p],
                    0.1 * one.findings[i].sigmas[p] + 1e-9 * std::abs(one.findings[i].term.values[p]))
            << k.plant << ' ' << one.findings[i].term.info->parameters[p].name;
  }
}

TEST(NoTrick, AnotherCutOfTheRecordingSaysTheSame) {
  for (const auto& k : known) {
    Trouble trouble;
    trouble.rows = k.rows;
    const auto machine = make(k.plant, k.effect, 1.0, k.seed, trouble);
    EXPECT_THAT(names(diagnosed(recut(machine, 0.0, 0.7, 1))), ::testing::Contains(k.effect)) << k.plant;
    const std::string plant{k.plant};
    // Where each row stands for itself or says where the machine is, a later part does as well, and every second row.
    if (plant == "error_map" || plant == "droplet" || plant == "sensor") {
      EXPECT_THAT(names(diagnosed(recut(machine, 0.3, 1.0, 1))), ::testing::Contains(k.effect)) << k.plant;
    }
    if (plant == "error_map" || plant == "droplet") {
      EXPECT_THAT(names(diagnosed(recut(machine, 0.0, 1.0, 2))), ::testing::Contains(k.effect)) << k.plant;
    }
  }
}

TEST(NoTrick, WithoutTheRightTermNoOtherIsClaimedWithConfidence) {
  for (const auto& k : known) {
    if (k.plant == std::string{"axis"} || k.plant == std::string{"equations"})
      continue;  // near twins: bench_mismatch --leave-out
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    diagnosis::Options options;
    options.without = {k.effect};
    const auto d = diagnosed(machine, options);
    for (const auto& finding : d.findings) {
      const std::string name{finding.term.info->name};
      EXPECT_NE(name, k.effect);
      EXPECT_TRUE(name == "unmodelled" || credit(machine, name) > 0.0)
          << k.plant << ' ' << k.effect << ": " << name;
    }
  }
}

// What comes nearest among the other names explains most of these; a free course, or what is left over, tells.
TEST(NoTrick, ANearNameIsNotClaimedWithConfidence) {
  constexpr Known near[] = {{"error_map", "sag", 6},
                            {"error_map", "thermal_expansion", 7},
                            {"error_map", "refractive_index", 9},
                            {"droplet", "stage_velocity_carry", 3},
                            {"droplet", "valve_delay", 7},
                            {"thermal", "radiation", 3},
                            {"thermal", "node_coupling", 7}};
  for (const auto& k : near) {
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    ASSERT_THAT(names(diagnosed(machine)), ::testing::Contains(k.effect)) << k.plant;
    diagnosis::Options options;
    options.without = {k.effect};
    for (const auto& finding : diagnosed(machine, options).findings) {
      const std::string name{finding.term.info->name};
      EXPECT_TRUE(name == "unmodelled" || credit(machine, name) > 0.0 || finding.probability < confident)
          << k.plant << ' ' << k.effect << ": " << name << ' ' << finding.probability;
    }
  }
}

TEST(NoTrick, WhatFollowsTheInputsIsNotCalledNoise) {
  diagnosis::Options options;
  options.without = {"sensor_lag"};
  for (const unsigned seed : {1006U, 2006U}) {
    const auto d = diagnosed(make("thermal", "sensor_lag", 1.0, seed), options);
    EXPECT_EQ(names(d).front(), "unknown_physics") << seed;
    EXPECT_TRUE(!d.findings.empty() || (d.suspect && !d.suspect->site.empty())) << seed;  // and it says where
  }
}

// A shaking that no course describes, because its mean is zero everywhere: only its size goes with the speed.
TEST(NoTrick, WhatIsLouderInMotionIsNotCalledNoise) {
  for (const unsigned seed : {1005U, 2005U}) {
    auto machine = make("sensor", "none", 1.0, seed);
    EXPECT_EQ(names(diagnosed(machine)).front(), "no_mismatch") << seed;
    const auto model = model_of(machine);
    const auto &place = model.signal("true_position")->column, &reading = model.signal("encoder")->column;
    double square = 0.0;
    for (const double v : machine.noise.at(reading)) square += v * v;
    const double noise = std::sqrt(square / static_cast<double>(machine.noise.at(reading).size()));
    Draw draw{seed};
    for (auto& table : machine.recordings) {
      std::vector<double> speed(table.rows(), 0.0);
      const auto& x = table.find(place)->values;
      for (std::size_t i = 1; i < x.size(); ++i)
        if (std::isfinite(x[i] - x[i - 1])) speed[i] = std::abs(x[i] - x[i - 1]);
      const double fastest = *std::max_element(speed.begin(), speed.end());
      for (auto& column : table.columns)
        for (std::size_t i = 0; column.name == reading && i < column.values.size(); ++i)
          column.values[i] += draw.normal(4.0 * noise * speed[i] / fastest);
    }
    const auto d = diagnosed(machine);
    EXPECT_EQ(names(d).front(), "unknown_physics") << seed;
    EXPECT_THAT(d.findings, ::testing::IsEmpty()) << seed;
  }
}

TEST(NoTrick, AGapInTheRecordingOfALoopIsNoPhysics) {
  Trouble trouble;
  trouble.faults = true;
  for (const unsigned seed : {3002U, 3012U})
    EXPECT_THAT(diagnosed(make("axis", "none", 1.0, seed, trouble)).findings, ::testing::IsEmpty()) << seed;
}

// A smooth term of few numbers fits any slow walk, and two roundings beat against each other.
TEST(NoTrick, NoiseThatWandersAndStepsThatBeatAreNoPhysics) {
  Trouble wander, steps;
  wander.colour = Colour::wander;
  steps.quantised = true;
  auto coarse = wander, faulty = wander;
  coarse.quantised = true, faulty.faults = true;
  const auto found = [](const char* plant, const char* effect, unsigned seed, const Trouble& trouble) {
    return diagnosed(make(plant, effect, 1.0, seed, trouble)).findings;
  };
  EXPECT_THAT(found("error_map", "none", 7005, faulty), ::testing::IsEmpty());
  EXPECT_THAT(found("error_map", "none", 7028, coarse), ::testing::IsEmpty());
  EXPECT_THAT(found("thermal", "none", 7008, coarse), ::testing::IsEmpty());
  EXPECT_THAT(found("thermal", "parameter", 3019, faulty), ::testing::IsEmpty());
  EXPECT_THAT(found("sensor", "none", 3003, steps), ::testing::IsEmpty());
}

// A third power for a second, a store for a lag: what is left over the name's own variable tells.
TEST(NoTrick, ARelativeIsNotStatedWithConfidence) {
  constexpr Known kin[] = {{"equations", "quadratic", 11004}, {"equations", "lag", 1004}};
  for (const auto& k : kin) {
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    diagnosis::Options options;
    options.without = {k.effect};
    for (const auto& finding : diagnosed(machine, options).findings)
      EXPECT_TRUE(finding.term.info->name == "unmodelled" || finding.probability < confident)
          << k.effect << ": " << finding.term.info->name << ' ' << finding.probability;
  }
}

// Heat that was switched in a gap came in nobody knows when.
TEST(NoTrick, AHeaterSwitchedInAGapIsNoPhysics) {
  Trouble trouble;
  trouble.faults = true;
  EXPECT_THAT(diagnosed(make("thermal", "parameter", 1.0, 9032, trouble)).findings, ::testing::IsEmpty());
  trouble.colour = Colour::heavy;
  EXPECT_THAT(diagnosed(make("thermal", "none", 1.0, 11001, trouble)).findings, ::testing::IsEmpty());
}

// A sine in time shows in one recording whether it enters at the motor or at the carriage, but not where.
TEST(NoTrick, ASineInTimeDoesNotSayWhereItEnters) {
  const auto machine = make("axis", "periodic_disturbance", 1.0, 6);
  diagnosis::Options options;
  options.without = {"periodic_disturbance"};
  for (const auto& finding : diagnosed(machine, options).findings)
    EXPECT_TRUE(finding.term.info->name == "unmodelled" || finding.probability < 0.5)
        << finding.term.info->name;
}

TEST(Named, ASquareWaveOnTheCurrentIsNoSumOfSines) {
  constexpr unsigned seed = 22015;
  const auto machine = make("axis", "additive_disturbance", 1.0, seed, {});
  const auto d = diagnosed(machine);
  ASSERT_EQ(d.findings.size(), 1U) << "seed " << seed;
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.info->name, "additive_disturbance") << "seed " << seed;
  EXPECT_GT(term.values[term.info->index_of("squareness")], 0.5) << "seed " << seed;
}

TEST(Named, TwoEffectsOfWhichNeitherDoesAnythingAloneAreFoundTogether) {
  constexpr unsigned seed = 1002;  // a heater at its limit makes the missing coupling look negative
  const auto all = names(diagnosed(make("thermal", "node_coupling+heater_saturation", 1.0, seed, {})));
  EXPECT_THAT(all, ::testing::UnorderedElementsAre("explained", "node_coupling", "heater_saturation"))
      << "seed " << seed;
}

physics::Record long_record(std::size_t rows, double step) {
  physics::Record record;
  for (std::size_t i = 0; i < rows; ++i) {
    record.time.push_back(step * static_cast<double>(i));
    const bool moves = (i / 1000) % 2 == 1;  // a second of rest, a second of travel
    const auto& r = record.signals["reference"];
    record.signals["reference"].push_back((r.empty() ? 0.0 : r.back()) + (moves ? 1e-4 : 0.0));
    record.signals["pad"].push_back(i % 7 == 0 ? 70.0 : 0.0);
    record.signals["slide"].push_back(20.0 + 1e-3 * static_cast<double>(i));
  }
  return record;
}

TEST(LongRecordings, AnAxisIsCutIntoStretchesThatBeginAtRest) {
  physics::Model model;
  model.plant = physics::Plant::axis;
  model.controller.emplace();
  const auto stretches = diagnosis::shortened(model, long_record(200000, 1e-3), 30000);
  ASSERT_EQ(stretches.size(), 5U);
  std::size_t rows = 0;
  double until = -1.0;
  for (const auto& stretch : stretches) {
    rows += stretch.record.rows();
    EXPECT_GT(stretch.record.time.front(), until);
    until = stretch.record.time.back();
    const auto& r = *stretch.record.find("reference");
    EXPECT_EQ(r[0], r[1]);
    EXPECT_EQ(stretch.forget > 0, stretch.record.time.front() > 0.0);
  }
  EXPECT_LE(rows, 30000U);
  EXPECT_GT(until, 160.0);  // the end is seen too
}

// A pause of a day at 1 kHz is 86 million ticks that no simulation should go through.
TEST(LongRecordings, ALoopThatPausedFallsApart) {
  physics::Model model;
  model.plant = physics::Plant::axis;
  model.controller.emplace().rate = 1000.0;
  auto record = long_record(20000, 1e-3);
  for (std::size_t i = 5000; i < 20000; ++i) record.time[i] += 86400.0;
  for (std::size_t i = 5100; i < 20000; ++i) record.time[i] += 3600.0;  // 100 rows say nothing
  for (std::size_t i = 9000; i < 20000; ++i) record.time[i] += 5.0;     // this is bridged
  const auto parts = diagnosis::without_pauses(model, record);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].record.rows(), 5000U);
  EXPECT_EQ(parts[0].forget, 0U);
  EXPECT_EQ(parts[1].record.rows(), 14900U);
  EXPECT_GT(parts[1].forget, 0U);
  EXPECT_EQ(parts[1].record.find("reference")->back(), record.find("reference")->back());
  model.plant = physics::Plant::sensor;
  EXPECT_EQ(diagnosis::without_pauses(model, record).size(), 1U);
}

TEST(LongRecordings, HeatIsKeptInMeans) {
  physics::Model model;
  model.plant = physics::Plant::thermal;
  model.signals = {{"slide", "", "degC", true}};
  const auto stretches = diagnosis::shortened(model, long_record(70000, 0.1), 10000);
  ASSERT_EQ(stretches.size(), 1U);
  const auto& record = stretches[0].record;
  ASSERT_EQ(record.rows(), 10000U);
  for (const double p : *record.find("pad")) EXPECT_DOUBLE_EQ(p, 10.0);
  for (std::size_t i = 0; i < record.rows(); i += 100)
    EXPECT_NEAR((*record.find("slide"))[i], 20.0 + 1e-2 * record.time[i], 1e-9);
}

TEST(LongRecordings, AShortOneStaysAsItIs) {
  physics::Model model;
  const auto stretches = diagnosis::shortened(model, long_record(500, 1e-3), 500);
  ASSERT_EQ(stretches.size(), 1U);
  EXPECT_EQ(stretches[0].record.rows(), 500U);
  EXPECT_EQ(stretches[0].forget, 0U);
}

/// Beside a wrong parameter the residual runs smoothly, and its scatter about its own median is nothing.
TEST(WrongReadings, AreLeftOutBesideAWrongParameter) {
  Trouble trouble;
  trouble.faults = true;
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    auto data = case_of(make("equations", "parameter", 1.0, seed, trouble));
    const auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
    EXPECT_EQ(d.verdict, diagnosis::Verdict::parameters_only)
        << seed << ": " << diagnosis::name_of(d.verdict);
    EXPECT_LT(d.unexplained, 1.2) << seed;
    EXPECT_GE(data.count.outliers, 1U) << seed;
    EXPECT_LE(data.count.outliers, 12U) << seed;
  }
}

}  // namespace
}  // namespace invar::test::mismatch
