// Dispensers: where drops land that fly from a moving stage, by Euler's rule in a thousand steps a flight.
#include <cmath>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

Machine make_droplet(const Wish& wish, Draw& draw) {
  const auto size = [&](const char* name) { return wish.of(name); };
  const double noise = draw.log_between(1e-5, 3e-5), speed = draw.between(1.5, 4.0);
  const double px = draw.normal(1e-4), py = draw.normal(1e-4), sx = draw.normal(0.01), sy = draw.normal(0.01);
  const double camera = draw.between(1.0e-5, 1.6e-5);
  // What flies on with the stage is known unless that is what is missing; drag then acts on it.
  const bool carried = true, carry_is_known = !wish.has("stage_velocity_carry") &&
                                              (wish.has("air_drag") || draw.once_in(2.0));
  const bool carries = wish.has("stage_velocity_carry") || (carried && carry_is_known);
  const double fastest = wish.has("stage_velocity_carry") ? 0.03 * wish.size : 0.15;
  const double fluid = wish.has("air_drag") ? 1e-4 / std::sqrt(std::max(0.05, wish.size)) : 0.0;
  const double wind_x = size("crosswind") * 6.0 * draw.sign(),
               wind_y = size("crosswind") * 6.0 * draw.between(-1.0, 1.0);
  const double duration = draw.between(100.0, 400.0), decay = size("speed_decay") * 1.0 / duration;
  const double delay = size("valve_delay") * 8e-4,
               exponent = std::min(0.8, 0.5 * size("pressure_dependence"));
  const double lens = size("lens_distortion") * 1.5e-8 * draw.sign(),
               turn = size("camera_rotation") * 4e-3 * draw.sign();
  const double jump_at = draw.between(0.35, 0.65) * duration;
  const double jump_x = size("unknown:jump") * 3.0 * noise * draw.sign(),
               jump_y = size("unknown:jump") * 2.0 * noise;
  const bool flight_matters = wish.has("stage_velocity_carry") || carry_is_known;

  double slope = sx;
  if (wish.has("parameter")) slope += draw.sign() * 0.002 * (4.0 + 3.0 * wish.size);
  Machine machine;
  machine.yaml =
      "invar_model: 1\nplant: droplet\ncolumns: {time: col_time, target_x: col_tx, target_y: col_ty, height: "
      "col_h, "
      "velocity_x: col_vx, velocity_y: col_vy, pressure: col_p, image_x: col_ix, image_y: col_iy, landed_x: "
      "col_lx, landed_y: col_ly}\nparameters:\n  placement_error_x: " +
      believed(px + draw.normal(1e-5), "m", 2e-5) +
      "\n  placement_error_y: " + believed(py + draw.normal(1e-5), "m", 2e-5) +
      "\n  slope_x: " + believed(slope + draw.normal(1e-3), "1", 2e-3) +
      "\n  slope_y: " + believed(sy + draw.normal(1e-3), "1", 2e-3) +
      "\n  speed: " + believed(speed * (1.0 + draw.normal(0.02)), "m/s", 0.04 * speed) +
      "\n  camera_scale: " + believed(camera, "m/px", 2e-8) + "\nnoise: {landed_x: " + text(noise) +
      ", landed_y: " + text(noise) +
      "}\nterms:" + (carry_is_known ? "\n  - {term: stage_velocity_carry}\n" : " []\n");

  const auto shoot = [&](std::size_t rows, bool with_noise, bool later) {
    recording::Table t;
    std::vector<double> c[9], x, y;
    const double mean_pressure = 9e4;
    for (std::size_t i = 0; i < rows; ++i) {
      const double time = later ? duration * draw.between(0.0, 1.0)
                                : duration * static_cast<double>(i) / static_cast<double>(rows);
      const double tx = draw.between(-0.05, 0.05), ty = draw.between(-0.03, 0.03);
      const double h = draw.between(0.003, 0.02), v = draw.between(-fastest, fastest);
      const double vx = v, vy = draw.once_in(2.0) ? draw.between(-fastest, fastest) : 0.0;
      const double pressure = draw.between(6e4, 1.2e5), ix = draw.between(-500.0, 500.0),
                   iy = draw.between(-400.0, 400.0);
      double v0 = speed * std::exp(-decay * time) * std::pow(pressure / mean_pressure, exponent);
      double u = (carries ? vx : 0.0) + v0 * sx, w = (carries ? vy : 0.0) + v0 * sy, fall = v0;
      double fx = 0.0, fy = 0.0, z = 0.0;
      const double step = h / v0 / 1000.0;
      if (fluid > 0.0) {
        for (int k = 0; k < 20000 && z < h; ++k) {
          const double going = std::sqrt(u * u + w * w + fall * fall);
          const double reynolds = 1.19 * going * fluid / 1.82e-5;
          const double rate =
              18.0 * 1.82e-5 / (998.0 * fluid * fluid) * (1.0 + 0.15 * std::pow(reynolds, 0.687));
          const double part = std::min(step, (h - z) / fall);
          fx += part * (u + 0.5 * part * (wind_x - rate * u)),
              fy += part * (w + 0.5 * part * (wind_y - rate * w));
          z += part * (fall + 0.5 * part * (9.81 - rate * fall));
          u += part * (wind_x - rate * u), w += part * (wind_y - rate * w),
              fall += part * (9.81 - rate * fall);
          if (part < step) break;
        }
      } else {
        const double time_of_flight = h / v0;
        fx = u * time_of_flight + 0.5 * wind_x * time_of_flight * time_of_flight;
        fy = w * time_of_flight + 0.5 * wind_y * time_of_flight * time_of_flight;
      }
      const double r2 = ix * ix + iy * iy;
      double lx = tx + px + fx + vx * delay + camera * (lens * r2 * ix - turn * iy);
      double ly = ty + py + fy + vy * delay + camera * (lens * r2 * iy + turn * ix);
      if (time > jump_at) lx += jump_x, ly += jump_y;
      const double off_x = draw.normal(noise), off_y = draw.normal(noise);
      if (with_noise) lx += off_x, ly += off_y;
      const double row[9] = {time, tx, ty, h, vx, vy, pressure, ix, iy};
      for (int k = 0; k < 9; ++k) c[k].push_back(row[k]);
      x.push_back(lx), y.push_back(ly);
    }
    const char* names[9] = {"col_time", "col_tx", "col_ty", "col_h", "col_vx",
                            "col_vy",   "col_p",  "col_ix", "col_iy"};
    const char* units[9] = {"s", "m", "m", "m", "m/s", "m/s", "Pa", "px", "px"};
    for (int k = 0; k < 9; ++k) t.add(names[k], units[k], c[k]);
    t.add("col_lx", "m", x);
    t.add("col_ly", "m", y);
    return t;
  };
  const auto rows = static_cast<std::size_t>(draw.between(180.0, 450.0));
  Draw twin = draw;
  machine.recordings.push_back(shoot(rows, true, false));
  draw = twin;
  machine.quiet.push_back(shoot(rows, false, false));
  auto test = shoot(160, false, true);
  machine.test_outputs.add("col_time", "s", test.columns.front().values);
  machine.test_outputs.columns.push_back(test.columns[9]);
  machine.test_outputs.columns.push_back(test.columns[10]);
  test.columns.resize(9);
  machine.test_inputs = test;

  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    std::map<std::string, double> names{{effect, 1.0}};
    std::vector<std::string> sites{"droplet.flight"}, depends_on;
    if (effect == "valve_delay" || effect == "pressure_dependence") sites = {"droplet.valve"};
    if (effect == "lens_distortion" || effect == "camera_rotation")
      sites = {"droplet.camera"}, depends_on = {"image"};
    if (effect == "unknown:jump") {
      names = {{"unmodelled", 1.0}};
      sites = {"droplet.flight", "droplet.valve", "droplet.camera"}, depends_on = {"time"};
    }
    machine.missing.push_back({names, sites, depends_on});
  }
  // Without a carried velocity the speed does not show in where a drop lands.
  if (!flight_matters && (wish.has("speed_decay") || wish.has("pressure_dependence")) &&
      !wish.has("crosswind"))
    machine.verdicts = {{"no_mismatch", 1.0}, {"explained", 1.0}};
  return machine;
}

}  // namespace invar::test::mismatch
