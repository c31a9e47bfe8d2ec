// Numbers of a report as somebody reads them.
#include "tools/report/page.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace invar::report {
namespace {

TEST(Numbers, TakeTheHandiestPrefixAndOnlyWhereTheUnitTakesOne) {
  EXPECT_EQ(si(4.1e-6, "m"), "4.1 um");
  EXPECT_EQ(si(0.78, "s", 2), "780 ms");
  EXPECT_EQ(si(35.15, "N/A"), "35.1 N/A");
  EXPECT_EQ(si(0.013, "1"), "0.013");
  EXPECT_EQ(si(95.0, "kg"), "95 kg");
  EXPECT_EQ(si(2e-8, "1/px2"), "2e-08 1/px2");
  EXPECT_EQ(si(0.0, "V"), "0 V");
}

TEST(Numbers, ShowTwoDigitsOfTheirSigma) {
  EXPECT_EQ(with_sigma(19.4, 0.7753, "s"), "19.40 +- 0.78 s");
  EXPECT_EQ(with_sigma(0.005006, 0.0001642, "W/K"), "5.01 +- 0.16 mW/K");
  EXPECT_EQ(with_sigma(-7.275e5, 698.6, "1"), "(-7.2750 +- 0.0070)e5");
  EXPECT_EQ(with_sigma(2.4, 0.0, "N"), "2.4 N");
  EXPECT_EQ(with_sigma(3.0, 40.0, "N"), "3 +- 40 N");
  EXPECT_EQ(with_sigma(5.5e-8, 1.0e-5, "m"), "0 +- 10 um");
}

TEST(Plots, ShowNumbersOneCanRead) {
  Plot plot;
  plot.x_label = "time [s]";
  plot.y_label = "error [m]";
  plot.series.resize(2);
  plot.series[0].x = {0.0, 4000.0};
  plot.series[0].y = {1e-7, std::nan("")};
  plot.series[1].y = {-4e-7, 2e-9};
  in_handy_units(plot);
  EXPECT_EQ(plot.x_label, "time [s]");
  EXPECT_EQ(plot.y_label, "error [nm]");
  EXPECT_DOUBLE_EQ(plot.series[0].x[1], 4000.0);
  EXPECT_DOUBLE_EQ(plot.series[0].y[0], 100.0);
  EXPECT_DOUBLE_EQ(plot.series[1].y[0], -400.0);
  plot.y_label = "exponent";
  in_handy_units(plot);
  EXPECT_EQ(plot.y_label, "exponent");
  EXPECT_DOUBLE_EQ(plot.series[1].y[0], -400.0);
}

}  // namespace
}  // namespace invar::report
