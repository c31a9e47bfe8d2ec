#include "tools/metrics/cell_metrics.hpp"

#include <algorithm>
#include <set>

namespace invar::tools {

namespace {

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

void add_percentiles(Families& out, const std::string& name, const std::string& help, const Labels& labels,
                     const lifecycle::Percentiles& p) {
  if (p.max_ns() == 0) return;
  for (const auto& [percentile, ns] :
       {std::pair{"50", p.p50_ns()}, {"99", p.p99_ns()}, {"99.9", p.p999_ns()}, {"100", p.max_ns()}}) {
    Labels with = labels;
    with.emplace_back("percentile", percentile);
    out.gauge(name, help, with, seconds(ns));
  }
}

void add_cell(Families& out, const CellLook& look) {
  const Labels cell{{"cell", look.status.cell}};
  out.gauge("build_info", "The version of the exporter; always 1",
            {{"cell", look.status.cell}, {"version", INVAR_VERSION}}, 1.0);
  if (!look.release.empty())
    out.gauge("deploy_info", "The release of `invar deploy` that the exporter belongs to; always 1",
              {{"cell", look.status.cell}, {"release", look.release}}, 1.0);
  out.gauge("cell_healthy", "1: `invar status` would find nothing wrong", cell,
            look.status.healthy() ? 1.0 : 0.0);
  out.gauge("cell_faults", "Faults of now, as `invar status` lists them", cell,
            static_cast<double>(look.status.faults().size()));
  out.gauge("cell_secured", "1: the cell knows its members by certificates", cell,
            look.status.secured ? 1.0 : 0.0);
  for (const auto& [from, number] : look.notices) {
    const auto& [source, level] = from;
    out.count("notices_total", "Notices since the exporter began",
              {{"cell", look.status.cell}, {"source", source}, {"level", level_text(level)}}, number);
  }
}

void add_loop(Families& out, const Labels& labels, const lifecycle::ProcessStatus& p) {
  out.gauge("process_realtime_granted", "1: all real-time means that the file asks for were granted", labels,
            p.realtime_granted() || !p.realtime_asked() ? 1.0 : 0.0);
  out.gauge("process_tripped", "1: tripped; `invar status` says why", labels,
            p.trip_reason().to_string().empty() ? 0.0 : 1.0);
  out.count("process_restarts_total", "How often `invar run` started it again", labels, p.restarts());
  out.count("process_lost_samples_total", "Samples and notices that it could not hand over", labels,
            p.lost());
  out.gauge("loop_period_seconds", "Nominal period of the loop", labels,
            p.rate() > 0.0 ? 1.0 / p.rate() : 0.0);
  out.count("loop_cycles_total", "Cycles of the loop", labels, p.cycles());
  out.count("loop_overruns_total", "Cycles that ended after the next one was due", labels, p.overruns());
  out.count("loop_skipped_cycles_total", "Cycles that were left out after an overrun", labels, p.skipped());
  if (p.latency_limit_ns() > 0) {
    out.gauge("loop_latency_limit_seconds", "Declared latency of a cycle", labels,
              seconds(p.latency_limit_ns()));
    out.count("loop_late_cycles_total", "Cycles that ended later than the declared latency", labels,
              p.late());
  }
  add_percentiles(out, "loop_wake_up_seconds", "Lateness of the loop's wake-ups in the last seconds", labels,
                  p.recent_wake_up());
  add_percentiles(out, "loop_compute_seconds", "Time of the loop's work in the last seconds", labels,
                  p.recent_compute());
  add_percentiles(out, "loop_latency_seconds",
                  "Time from when a cycle was due to the end of its work in the last seconds", labels,
                  p.recent_latency());
}

/// Of each host by the process that knows its clock best.
void add_clocks(Families& out, const CellStatus& status, const std::set<std::string>& up) {
  std::map<std::string, const lifecycle::ProcessStatus*> hosts;
  for (const auto& p : status.processes) {
    if (!up.contains(p.process_name().c_str()) || p.clock_error_ns() < 0 || p.clock_reference().size() == 0)
      continue;
    const auto [known, first] = hosts.try_emplace(p.host().c_str(), &p);
    if (!first && p.clock_error_ns() < known->second->clock_error_ns()) known->second = &p;
  }
  for (const auto& [host, p] : hosts) {
    const Labels labels{{"cell", status.cell}, {"host", host}, {"reference", p->clock_reference().c_str()}};
    out.gauge("host_clock_offset_seconds", "Clock of the host less that of the reference", labels,
              seconds(p->clock_ahead_ns()));
    out.gauge("host_clock_error_seconds", "Half of the round trip, within which the offset is known", labels,
              seconds(p->clock_error_ns()));
  }
}

std::set<std::string> add_processes(Families& out, const CellStatus& status) {
  std::set<std::string> up;
  const auto add_up = [&](const std::string& name, const std::string& host, bool is_up) {
    out.gauge("process_up", "1: the process was heard within the last three seconds",
              {{"cell", status.cell}, {"process", name}, {"host", host}}, is_up ? 1.0 : 0.0);
    if (is_up) up.insert(name);
  };
  for (const auto& p : status.processes) {
    const std::string name = p.process_name().c_str();
    const bool is_up = p.pid() != 0 && !status.silent.contains(name);
    add_up(name, p.host().c_str(), is_up);
    if (is_up) add_loop(out, {{"cell", status.cell}, {"process", name}}, p);
  }
  for (const auto& name : status.missing) add_up(name, "", false);
  add_clocks(out, status, up);
  return up;
}

void add_inputs(Families& out, const Labels& labels, const lifecycle::ComponentStatus& c) {
  for (const auto& input : c.inputs()) {
    Labels with = labels;
    with.emplace_back("port", input.port().c_str());
    out.count("input_late_steps_total", "Steps that read a sample older than the declared latency", with,
              input.late());
    out.gauge("input_latency_limit_seconds", "Declared latency of an input", with, seconds(input.limit_ns()));
  }
}

void add_components(Families& out, const CellStatus& status, const std::set<std::string>& up) {
  for (const auto& c : status.components) {
    if (!up.contains(c.process_name().c_str())) continue;
    const Labels labels{{"cell", status.cell},
                        {"component", c.component_name().c_str()},
                        {"process", c.process_name().c_str()}};
    for (const auto state : {lifecycle::STATE_UNCONFIGURED, lifecycle::STATE_INACTIVE,
                             lifecycle::STATE_ACTIVE, lifecycle::STATE_FINALIZED, lifecycle::STATE_ERROR}) {
      Labels with = labels;
      with.emplace_back("state", state_text(state));
      out.gauge("component_state", "1: the component is in this state", with, c.state() == state ? 1.0 : 0.0);
    }
    out.gauge("component_fault", "1: the component goes on, but is at fault; `invar status` says how", labels,
              c.fault().to_string().empty() ? 0.0 : 1.0);
    out.count("component_steps_total", "Steps of the component", labels, c.steps());
    out.count("component_refused_samples_total", "Samples that its inputs refused", labels, c.lost());
    add_percentiles(out, "component_step_seconds", "Time of one step in the last seconds", labels,
                    c.recent_compute());
    add_inputs(out, labels, c);
  }
}

void add_topics(Families& out, const CellLook& look) {
  for (const auto& [topic, flows] : look.flows) {
    std::uint64_t samples = 0, bytes = 0, missing = 0;
    for (const auto& [writer, flow] : flows) {
      samples += flow.samples;
      bytes += flow.bytes;
      missing += flow.missing;
    }
    const Labels labels{{"cell", look.status.cell}, {"topic", topic}};
    out.count("topic_samples_total", "Samples that reached the exporter", labels, samples);
    out.count("topic_bytes_total", "Bytes of these samples", labels, bytes);
    out.count("topic_lost_samples_total", "Gaps in the writers' numbers", labels, missing);
  }
}

template <class Sample, class Visit>
void each(const Signs<Sample>& signs, const std::string& cell, const char* part, Visit visit) {
  for (const auto& [key, seen] : signs)
    visit(Labels{{"cell", cell}, {"topic", key.first}, {part, std::to_string(key.second)}}, seen.first);
}

void add_devices(Families& out, const std::string& cell, const DeviceSigns::Seen& devices) {
  const auto flag = [&](const char* name, const char* help, const Labels& labels, bool is_set) {
    out.gauge(name, help, labels, is_set ? 1.0 : 0.0);
  };
  constexpr const char* answers = "1: the device answers";
  each(devices.axes, cell, "axis", [&](const Labels& labels, const stage::AxisState& axis) {
    flag("axis_in_fault", "1: the axis is in fault", labels, axis.mode() == stage::AXIS_MODE_FAULT);
    flag("axis_enabled", "1: the drive is enabled", labels, axis.enabled());
  });
  each(devices.heaters, cell, "node", [&](const Labels& labels, const thermal::NodeTemperature& node) {
    flag("heater_device_up", answers, labels, !node.stale());
    flag("heater_latched", "1: over-temperature has latched the heater off", labels, node.over_temperature());
    flag("heater_watchdog_tripped", "1: the controller's watchdog has switched the heater off", labels,
         node.watchdog_tripped());
    if (node.stale()) return;
    out.gauge("heater_temperature_celsius", "Temperature", labels, node.temperature());
    out.gauge("heater_setpoint_celsius", "Setpoint of the temperature", labels, node.setpoint());
    out.gauge("heater_power_watts", "Power of the heater", labels, node.heater_power());
  });
  each(devices.pressures, cell, "node", [&](const Labels& labels, const dispensing::PressureState& node) {
    flag("pressure_device_up", answers, labels, !node.stale() && !node.comm_lost());
    flag("pressure_latched", "1: the pressure is latched off", labels,
         node.over_pressure() || node.sensor_fault());
    if (!node.stale()) out.gauge("pressure_pascals", "Pressure over ambient", labels, node.pressure());
  });
}

void add_recorders(Families& out, const std::string& cell, const DeviceSigns::Seen& devices) {
  for (const auto& [key, seen] : devices.recorders) {
    const recorder::RecorderStatus& status = seen.first;
    const Labels labels{{"cell", cell}, {"topic", key.first}};
    const auto bytes = [&](const char* name, const char* help, std::uint64_t value) {
      out.gauge(name, help, labels, static_cast<double>(value));
    };
    bytes("recorder_file_bytes", "Size of the recording so far", status.file_bytes());
    bytes("recorder_disk_free_bytes", "Free space of the recorder's disk", status.free_bytes());
    bytes("recorder_disk_reserve_bytes", "Free space at which recording ends", status.reserve_bytes());
    out.count("recorder_samples_total", "Samples in the recording", labels, status.samples());
    out.count("recorder_lost_samples_total", "Samples lost since the disk was slower than the cell", labels,
              status.lost());
  }
}

}  // namespace

Families metrics_of(const CellLook& look) {
  Families out;
  add_cell(out, look);
  add_components(out, look.status, add_processes(out, look.status));
  add_topics(out, look);
  add_devices(out, look.status.cell, look.devices);
  add_recorders(out, look.status.cell, look.devices);
  return out;
}

}  // namespace invar::tools
