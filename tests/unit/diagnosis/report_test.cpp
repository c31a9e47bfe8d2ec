// report.json against the contract, key by key, for every verdict.
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/options.hpp"
#include "tests/support/mismatch/marks.hpp"
#include "tools/diagnose/report_page.hpp"

namespace invar::test::mismatch {
namespace {

using diagnosis::Verdict;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// No number may have become null (NaN and infinity are no JSON).
void expect_no_null(const json& value, const std::string& at) {
  EXPECT_FALSE(value.is_null()) << at;
  if (value.is_object() || value.is_array())
    for (const auto& [key, inner] : value.items()) expect_no_null(inner, at + "/" + key);
}

bool is_share(const json& value) { return value.is_number() && value >= 0.0 && value <= 1.0; }
bool is_texts(const json& value) {
  return value.is_array() &&
         std::all_of(value.begin(), value.end(), [](const json& v) { return v.is_string(); });
}

void expect_location(const json& location, const std::string& plant) {
  EXPECT_TRUE(location.at("site").get<std::string>().starts_with(plant + "."));
  EXPECT_TRUE(is_texts(location.at("depends_on")));
  for (const auto& [variable, range] : location.at("where").items()) {
    ASSERT_EQ(range.size(), 2U) << variable;
    EXPECT_LE(range[0].get<double>(), range[1].get<double>());
  }
  EXPECT_TRUE(is_share(location.at("share")));
  EXPECT_FALSE(location.at("why").get<std::string>().empty());
}

void expect_finding(const json& finding, const std::string& plant) {
  EXPECT_TRUE(finding.at("term").is_string());
  EXPECT_TRUE(finding.at("site").get<std::string>().starts_with(plant + "."));
  EXPECT_TRUE(is_share(finding.at("probability")));
  EXPECT_TRUE(is_share(finding.at("share")));
  EXPECT_FALSE(finding.at("description").get<std::string>().empty());
  for (const auto& [name, p] : finding.at("parameters").items()) {
    EXPECT_TRUE(p.at("value").is_number() && p.at("unit").is_string()) << name;
    EXPECT_GE(p.at("sigma").get<double>(), 0.0) << name;
  }
  double sum = finding.at("probability");
  for (const auto& a : finding.at("alternatives")) {
    EXPECT_FALSE(a.at("site").get<std::string>().empty());
    EXPECT_TRUE(a.at("term").is_string() && is_share(a.at("probability")));
    sum += a.at("probability").get<double>();
  }
  EXPECT_LE(sum, 1.0 + 1e-9);
}

void expect_contract(const diagnosis::Case& data, const diagnosis::Diagnosis& d, const std::string& plant) {
  const auto report = json::parse(diagnosis::report_json(data, d));
  SCOPED_TRACE(report.dump(1));
  expect_no_null(report, "");
  EXPECT_EQ(report.at("invar_report"), 1);
  EXPECT_EQ(report.at("verdict"), diagnosis::name_of(d.verdict));
  EXPECT_EQ(report.contains("partial"), d.is_partial);
  const auto& mismatch = report.at("mismatch");
  EXPECT_TRUE(mismatch.at("significant").is_boolean());
  EXPECT_GE(mismatch.at("residual_over_noise").get<double>(), 0.0);
  EXPECT_TRUE(is_share(mismatch.at("p_value")));
  for (const auto& location : report.at("location")) expect_location(location, plant);
  for (const auto& finding : report.at("findings")) expect_finding(finding, plant);
  EXPECT_GE(report.at("location").size(), report.at("findings").size());
  for (const auto& c : report.at("parameter_corrections"))
    EXPECT_TRUE(c.at("name").is_string() && c.at("from").is_number() && c.at("to").is_number() &&
                c.at("sigma").is_number());
  for (const auto* part : {"heldout", "train"}) {
    EXPECT_EQ(report.at("fit").at(part).size(), data.outputs.size());
    for (const auto& [signal, row] : report.at("fit").at(part).items()) {
      EXPECT_TRUE(row.at("unit").is_string()) << signal;
      for (const auto* number : {"before", "retuned", "after", "noise_floor"})
        EXPECT_GE(row.at(number).get<double>(), 0.0) << signal << ' ' << number;
    }
  }
  EXPECT_TRUE(report.at("fit").at("split").is_string());
  for (const auto& a : report.at("ambiguity")) {
    ASSERT_EQ(a.at("between").size(), 2U);
    EXPECT_TRUE(is_texts(a.at("between")));
    EXPECT_NE(a.at("between")[0], a.at("between")[1]);
    EXPECT_FALSE(a.at("experiment").get<std::string>().empty());
  }
  EXPECT_TRUE(report.at("unexplained").at("residual_over_noise").is_number());
  EXPECT_TRUE(is_texts(report.at("unexplained").at("depends_on")));
  for (const auto& s : report.at("detectable")) {
    EXPECT_TRUE(s.at("term").is_string() && s.at("smallest").at("unit").is_string());
    EXPECT_GT(s.at("smallest").at("value").get<double>(), 0.0);
    if (s.contains("at")) {
      for (const auto& [name, at] : s.at("at").items()) {
        EXPECT_TRUE(name == "pitch" || name == "frequency") << name;
        EXPECT_GT(at.at("value").get<double>(), 0.0);
      }
    }
  }
  for (const auto& r : report.at("rejected"))
    EXPECT_TRUE(r.at("term").is_string() && !r.at("why").get<std::string>().empty());
  EXPECT_LE(report.at("data").at("used").get<int>(), report.at("data").at("rows").get<int>());
  for (const auto* cause : {"nan", "outlier"})
    EXPECT_TRUE(report.at("data").at("dropped").at(cause).is_number_unsigned());
  EXPECT_EQ(report.at("patched_model"), "patched.yaml");

  const bool claims = !report.at("findings").empty();
  switch (d.verdict) {
    case Verdict::no_mismatch:
      EXPECT_FALSE(claims);
      EXPECT_FALSE(d.is_partial) << "half a search says that nothing is missing";
      EXPECT_FALSE(mismatch.at("significant"));
      EXPECT_GT(mismatch.at("p_value"), 0.0026);  // within three sigma of what the user believed
      break;
    case Verdict::parameters_only:
      EXPECT_FALSE(claims);
      EXPECT_FALSE(d.is_partial);
      EXPECT_FALSE(report.at("parameter_corrections").empty());
      EXPECT_TRUE(mismatch.at("significant"));
      break;
    case Verdict::ambiguous:
      EXPECT_FALSE(report.at("ambiguity").empty());
      EXPECT_TRUE(claims || d.is_partial);
      break;
    case Verdict::unknown_physics:
      EXPECT_FALSE(report.at("location").empty());
      for (const auto& finding : report.at("findings")) EXPECT_EQ(finding.at("term"), "unmodelled");
      break;
    default:
      EXPECT_TRUE(claims);
      EXPECT_TRUE(mismatch.at("significant"));
  }
}

TEST(Report, HoldsTheContractForEveryVerdict) {
  std::set<Verdict> seen;
  const auto look = [&](const diagnosis::Case& data, const diagnosis::Diagnosis& d,
                        const std::string& plant) {
    seen.insert(d.verdict);
    expect_contract(data, d, plant);
  };
  for (const auto& [plant, effect, seed] : {std::tuple{"thermal", "none", 5U},
                                            {"thermal", "parameter", 5U},
                                            {"thermal", "sensor_lag", 3U},
                                            {"error_map", "unknown:dent", 1011U}}) {
    SCOPED_TRACE(std::string{plant} + " " + effect);
    auto data = case_of(make(plant, effect, 1.0, seed));
    auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
    look(data, d, plant);
    if (d.verdict != Verdict::explained) continue;
    // The same with a rest, and with a rival that comes as near: of another name, and of its own elsewhere.
    d.verdict = Verdict::partly_explained;
    look(data, d, plant);
    d.verdict = Verdict::ambiguous;
    auto& finding = d.findings.front();
    finding.probability = 0.5;
    auto rival = finding.term;
    rival.on = "elsewhere";
    finding.alternatives = {{rival, -0.1}};
    look(data, d, plant);
    EXPECT_THAT(diagnosis::next_experiment(data, d), HasSubstr("elsewhere"));
  }
  EXPECT_EQ(seen.size(), 6U);
}

TEST(Report, OfASearchThatWasStoppedSaysFirstThatNothingCanBeSaid) {
  for (const char* effect : {"none", "parameter", "sensor_lag"}) {
    auto data = case_of(make("thermal", effect, 1.0, 3));
    diagnosis::Options stop;
    std::stop_source requested;
    requested.request_stop();
    stop.stop = requested.get_token();
    const auto d = diagnosis::diagnose(
        data, [](double, const std::string&) {}, stop);
    EXPECT_TRUE(d.is_partial);
    EXPECT_TRUE(d.findings.empty());
    expect_contract(data, d, "thermal");
    EXPECT_THAT(diagnosis::summary(data, d), StartsWith("Not finished, nothing can be said."));
    const auto page = diagnosis::page_text(data, d, "model.yaml");
    EXPECT_NE(page.find("Not finished, nothing can be said."), std::string::npos);
    EXPECT_EQ(page.find("nothing that this recording shows"), std::string::npos);
  }
}

// What is named explains little where the model's own numbers had to leave what is known, or much remains.
TEST(Report, SaysBesideTheVerdictWhatItWouldHide) {
  auto data = case_of(make("thermal", "sensor_lag", 1.0, 3));
  auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
  ASSERT_FALSE(d.findings.empty());
  EXPECT_EQ(diagnosis::beside_the_verdict(data, d), "");
  EXPECT_EQ(diagnosis::page_text(data, d, "model.yaml").find("Mind: "), std::string::npos);
  d.unexplained = 96.0;
  EXPECT_EQ(diagnosis::beside_the_verdict(data, d), "Mind: what remains is 96 times the noise.");
  const auto own = std::find_if(d.best.free.begin(), d.best.free.end(), [](const auto& f) {
    return f.where == diagnosis::Freedom::Where::parameter && f.sigma > 0.0;
  });
  ASSERT_NE(own, d.best.free.end());
  auto& parameter = d.best.model.parameters[own->index];
  parameter.value = own->center + 770.0 * own->sigma;
  const auto said = diagnosis::beside_the_verdict(data, d);
  EXPECT_THAT(said, StartsWith("Mind: with it " + parameter.name + " is "));
  EXPECT_THAT(said, HasSubstr("(770 sigma of what was believed); what remains is 96 times the noise."));
  EXPECT_THAT(diagnosis::summary(data, d), HasSubstr(".\n" + said + "\n"));
  EXPECT_THAT(diagnosis::next_experiment(data, d),
              ::testing::Not(HasSubstr("First look")));  // what is missing moved it
  d.unexplained = 1.0;
  EXPECT_THAT(diagnosis::next_experiment(data, d),
              StartsWith("First look at the value, unit, sign and sigma that the model's file gives for " +
                         parameter.name + ". "));
  parameter.value = 1000.0 * own->center;
  EXPECT_THAT(diagnosis::next_experiment(data, d),
              HasSubstr("for " + parameter.name + " (1000 of it, as of a prefix). "));
  parameter.value = own->center + 770.0 * own->sigma;
  data.doubts = {"units: `a` [V] measures something else than `b` [N]"};
  EXPECT_THAT(diagnosis::beside_the_verdict(data, d),
              ::testing::EndsWith("; units: `a` [V] measures something else than `b` [N]."));
  data.doubts.clear();
  d.unexplained = 96.0;
  const auto page = diagnosis::page_text(data, d, "model.yaml");
  EXPECT_LT(page.find(said), page.find("<table"));
}

// A force that grows with the time is a third of its most after a third of it, and in a loop the current tells.
TEST(Report, SaysInWhichRegionAnEffectShows) {
  const auto machine = make("axis", "slow_drift", 1.0, 6001);
  auto data = case_of(machine);
  const auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
  const auto report = json::parse(diagnosis::report_json(data, d));
  SCOPED_TRACE(report.at("location").dump(1));
  ASSERT_EQ(report.at("findings")[0].at("term"), "slow_drift");
  const auto where = report.at("location")[0].at("where").at("time");
  const double end = data.recordings[0].inputs.time.back();
  EXPECT_NEAR(where[0].get<double>(), end / 3.0, end / 30.0);
  EXPECT_NEAR(where[1].get<double>(), end, end / 30.0);
  EXPECT_NE(diagnosis::page_text(data, d, "model.yaml").find(", most at time "), std::string::npos);
}

}  // namespace
}  // namespace invar::test::mismatch
