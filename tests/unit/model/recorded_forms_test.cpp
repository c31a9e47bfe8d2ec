// Recordings as users have them: rows at a rate, columns nobody asked for, and units of what turns, heats or is commanded.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "core/base/unit.hpp"
#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/counted_units.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/model_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::model {
namespace {

using test::model_of;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pointwise;

constexpr double turn = 2.0 * std::numbers::pi, degree = std::numbers::pi / 180.0;

class RecordedForms : public ::testing::Test {
 protected:
  [[nodiscard]] RecordFile read(const physics::Model& model, const std::string& csv) const {
    const auto file = folder / "r.csv";
    std::ofstream{file} << csv;
    return to_record(read_recording(file, model).front(), model, true);
  }
  [[nodiscard]] std::string fault_of(const physics::Model& model, const std::string& csv) const {
    return invar::testing::fault_of([&] { (void)read(model, csv); });
  }
  invar::testing::TemporaryFolder folder;
};

physics::Model heater(const std::string& columns, const std::string& gain) {
  return model_of(
      "invar_model: 1\nplant: thermal\ncolumns: " + columns +
      "\nnodes: {block: {column: T, capacity: {value: 18, unit: J/K}, loss: {value: 0.1, unit: W/K}}}\n"
      "heaters: {pad: {node: block, column: P, gain: " +
      gain + "}}\nambient: {value: 23, unit: degC}\n");
}

TEST_F(RecordedForms, RowsAtARateNeedNoTime) {
  const auto model = heater("{rate: 4}", "1.0");
  const auto file = read(model, "T [degC],P [W]\n20,1\n21,1\n22,1\n");
  EXPECT_THAT(file.record.time, ElementsAre(0.0, 0.25, 0.5));
  EXPECT_EQ(to_table(model, file, {{20.0, 21.0, 22.0}}).find("time")->unit, "s");
  EXPECT_THAT(
      read(heater("{rate: {value: 6, unit: 1/min}}", "1.0"), "T [degC],P [W]\n20,1\n21,1\n").record.time,
      Pointwise(DoubleNear(1e-12), {0.0, 10.0}));
  EXPECT_THAT(invar::testing::fault_of([] { (void)heater("{time: t, rate: 4}", "1.0"); }),
              HasSubstr("stands beside `time`"));
  EXPECT_THAT(invar::testing::fault_of([] { (void)heater("{}", "1.0"); }),
              HasSubstr("or `rate: <rows a second>`"));
  EXPECT_THAT(invar::testing::fault_of([] { (void)heater("{rate: 0}", "1.0"); }), HasSubstr("columns.rate"));
}

TEST_F(RecordedForms, ColumnsThatTheModelDoesNotNameMayHoldAnything) {
  const auto model = heater("{time: time}", "1.0");
  const auto file = read(model,
                         "time [s],received [s],sequence,mode,T (C),note,P [W]\n"
                         "0,0.1,1,AUTO,20,\"a, b\",5\n1,1.1,2,HAND,21,,6\n");
  EXPECT_THAT(file.record.signals.at("block"), ElementsAre(20.0, 21.0));
  EXPECT_THAT(file.record.signals.at("pad"), ElementsAre(5.0, 6.0));
  EXPECT_THAT(fault_of(model, "time [s],T [degC],note\n0,1,a\n"),
              HasSubstr("has no column `P` for `pad`; add it, or name the right one in the model (there are: "
                        "time, T, note)"));
  EXPECT_THAT(fault_of(model, "0,1,2\n1,1,2\n"),
              HasSubstr("no header: name columns by number (there are: 1, 2, 3)"));
  EXPECT_THAT(fault_of(model, "time [s],T [degC],P [W]\n0,1,on\n"),
              HasSubstr("column `P`: `on` is not a number"));
}

TEST_F(RecordedForms, AHeatersGainIsPerWhateverItsColumnIsIn) {
  const auto power = [&](const std::string& gain, const std::string& header, double value) {
    const auto model = heater("{time: t}", gain);
    const auto file = read(model, "t [s],T [degC],P" + header + "\n0,20," + std::to_string(value) + "\n");
    return model.value("pad.gain") * file.record.signals.at("pad").front();  // [W]
  };
  EXPECT_NEAR(power("{value: 0.02, unit: W/%}", " [%]", 25.0), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 0.02, unit: W/%}", " [1]", 0.25), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 2, unit: W/W}", " [%]", 25.0), 0.5, 1e-12);  // W per 1
  EXPECT_NEAR(power("{value: 2, unit: W}", " [%]", 25.0), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 2, unit: W}", "", 0.25), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 2000, unit: mW/V}", " [mV]", 250.0), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 2, unit: mW/duty}", "", 250.0), 0.5, 1e-12);
  EXPECT_NEAR(power("{value: 0.5}", " [kW]", 0.001), 0.5, 1e-12);
  const auto model = heater("{time: t}", "{value: 2, unit: W/W}");
  EXPECT_THAT(read(model, "t [s],T [degC],P [%]\n0,1,2\n").doubts,
              ElementsAre(HasSubstr("the gain of `pad` is taken in W per 1")));
  EXPECT_THAT(read(model, "t [s],T [degC],P [mW]\n0,1,2\n").doubts, ::testing::IsEmpty());
  EXPECT_THAT(fault_of(model, "t [s],T [degC],P [degC]\n0,1,2\n"), HasSubstr("is in `degC`, which is no W"));
  EXPECT_THAT(fault_of(heater("{time: t}", "{value: 2, unit: W/V}"), "t [s],T [degC],P [%]\n0,1,2\n"),
              HasSubstr("is in `%`, which is no V"));
  auto changed = model_of(
      "invar_model: 1\nplant: thermal\ncolumns: {time: t}\nnodes: {b: {column: T, capacity: 1, loss: 1}}\n"
      "heaters: {h: {node: b, column: P, gain: {value: 2, unit: W/%}}}\nambient: 20\n"
      "terms: [{term: heater_saturation, power: {value: 60, unit: '%'}}]\n");
  EXPECT_EQ(physics::unit_of_parameter(changed, changed.terms[0], 0), "%");
}

constexpr const char* rotor =
    "invar_model: 1\nplant: axis\ncolumns: {time: t, position: angle, current: i}\n"
    "parameters: {mass: {value: 53, unit: g cm2}, motor_constant: {value: 25, unit: N m/kA}, "
    "viscous_damping: {value: 1.0e-6, unit: N m s/rad}}\n"
    "terms: [{term: coulomb_friction, level: {value: 2.5, unit: mN m}}, {term: force_ripple, pitch: {value: "
    "360, "
    "unit: deg}, amplitude: {value: 1, unit: N m}}]\n";

TEST_F(RecordedForms, AnAxisWithAMomentOfInertiaTurns) {
  const auto model = model_of(rotor);
  EXPECT_TRUE(physics::is_rotary(model));
  EXPECT_NEAR(model.value("mass"), 5.3e-6, 1e-18);
  EXPECT_NEAR(model.value("motor_constant"), 0.025, 1e-15);
  EXPECT_EQ(model.find("motor_constant")->unit, "N m/A");
  EXPECT_NEAR(model.terms[0].values[0], 2.5e-3, 1e-15);
  EXPECT_NEAR(model.terms[1].values[model.terms[1].info->index_of("pitch")], turn, 1e-12);
  const auto degrees = read(model, "t [s],angle [deg],i [A]\n0,90,1\n1,180,2\n");
  EXPECT_THAT(degrees.record.signals.at("position"),
              Pointwise(DoubleNear(1e-12), {90 * degree, 180 * degree}));
  EXPECT_THAT(to_table(model, degrees, {{90 * degree, 180 * degree}}).find("angle")->values,
              Pointwise(DoubleNear(1e-9), {90.0, 180.0}));
  EXPECT_THAT(fault_of(model, "t [s],angle [mm],i [A]\n0,90,1\n"), HasSubstr("is in `mm`, which is no rad"));
  const auto text = patched(config::Yaml::parse(rotor, "model.yaml"), model);
  EXPECT_THAT(text, HasSubstr("unit: N m"));
  EXPECT_EQ(model_of(text).terms[0].values, model.terms[0].values);
  EXPECT_FALSE(
      physics::is_rotary(model_of("invar_model: 1\nplant: axis\ncolumns: {time: t, position: x, current: i}\n"
                                  "parameters: {mass: 3, motor_constant: 20, viscous_damping: 1}\n")));
}

TEST_F(RecordedForms, ASensorMeasuresAnglesWhereResolutionOrColumnsSaySo) {
  const std::string head =
      "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: a, encoder: e, "
      "velocity_sensor: v}\n";
  const char* csv = "t [s],a [deg],e [deg],v [rpm]\n0,90,91,60\n";
  for (const std::string parameters :
       {"parameters: {}\n", "parameters: {resolution: {value: 0.1, unit: deg}}\n"}) {
    const auto model = model_of(head + parameters);
    const auto file = read(model, csv);
    EXPECT_NEAR(file.record.signals.at("encoder").front(), 91 * degree, 1e-12) << parameters;
    EXPECT_NEAR(file.record.signals.at("velocity_sensor").front(), turn, 1e-12) << parameters;
  }
  const auto open = model_of(head + "parameters: {}\n");
  const auto inputs = to_record(read_recording(folder / "r.csv", open).front(), open, false);
  EXPECT_EQ(to_table(open, inputs, {{1.0}, {1.0}}).find("e")->unit, "deg");
  const auto of_lengths = model_of(head + "parameters: {resolution: {value: 1, unit: um}}\n");
  EXPECT_THAT(fault_of(of_lengths, csv), HasSubstr("is in `deg`, which is no m"));
}

TEST(TurnsAndAngles, AreTwoPiApart) {
  EXPECT_NEAR(conversion("Hz", "rad/s")->factor, turn, 1e-12);
  EXPECT_NEAR(conversion("rad/s", "Hz")->factor, 1.0 / turn, 1e-12);
  EXPECT_NEAR(conversion("deg/s", "mHz")->factor, 1e3 / 360.0, 1e-9);
  EXPECT_NEAR(conversion("rpm", "Hz")->factor, 1.0 / 60.0, 1e-12);
  EXPECT_NEAR(conversion("N m/rpm", "N m s/rad")->factor, 60.0 / turn, 1e-9);
  EXPECT_NEAR(conversion("1/s", "Hz")->factor, 1.0, 1e-12);
}

TEST_F(RecordedForms, AColumnInHertzBesideAStateInRadiansIsConverted) {
  const auto first = [&](const std::string& header, const std::string& state) {
    const auto model = model_of(
        "invar_model: 1\nplant: equations\ncolumns: {time: t}\nstates: {w: {derivative: '-k*w', initial: "
        "{value: 1, "
        "unit: " +
        state +
        "}}}\noutputs: {speed: {column: v, expression: w}}\nparameters: {k: {value: 1, unit: 1/s}}\n");
    return read(model, "t [s],v [" + header + "]\n0,3\n1,2\n").record.signals.at("speed").front();
  };
  EXPECT_NEAR(first("Hz", "rad/s"), 3.0 * turn, 1e-12);
  EXPECT_NEAR(first("Hz", "deg/s"), 3.0 * 360.0, 1e-9);
  EXPECT_NEAR(first("rad/s", "Hz"), 3.0 / turn, 1e-12);
  EXPECT_NEAR(first("rad/s", "rad/s"), 3.0, 1e-12);
  EXPECT_NEAR(first("rpm", "rad/s"), 3.0 * turn / 60.0, 1e-12);
}

TEST_F(RecordedForms, CAndFAreDegreesBesideATemperature) {
  const auto first = [&](const std::string& header, const std::string& state) {
    const auto model = model_of(
        "invar_model: 1\nplant: equations\ncolumns: {time: t}\nstates: {x: {derivative: '-k*x', initial: "
        "{value: 1, "
        "unit: " +
        state + "}}}\noutputs: {y: {column: y, expression: x}}\nparameters: {k: {value: 1, unit: 1/s}}\n");
    return read(model, "t (s),y (" + header + ")\n0,50\n1,2\n").record.signals.at("y").front();
  };
  EXPECT_NEAR(first("C", "degC"), 50.0, 1e-12);
  EXPECT_NEAR(first("F", "degC"), 10.0, 1e-12);
  EXPECT_NEAR(first("C", "K"), 323.15, 1e-9);
  EXPECT_NEAR(first("F", "F"), 50.0, 1e-12);  // farads
  EXPECT_NEAR(conversion("C", "K")->operator()(0.0), 273.15, 1e-9);
  EXPECT_FALSE(conversion("C", "m").has_value());
}

}  // namespace
}  // namespace invar::model
