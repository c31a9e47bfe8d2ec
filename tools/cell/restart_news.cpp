#include "tools/cell/restart_news.hpp"

#include <spdlog/spdlog.h>

#include <exception>

#include "core/base/clock.hpp"
#include "core/base/shown.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/node.hpp"
#include "core/dds/simulated_clock.hpp"
#include "idl/event.h"
#include "idl/lifecycle.h"
#include "tools/host/own_host.hpp"

namespace invar::tools {

namespace {

dds::NodeOptions node_options(const config::Cell& cell, const config::CellProcess& process) {
  dds::NodeOptions options = node_on(cell, "launcher", process.host);
  if (options.identity) options.identity->name = config::launcher_name(process.host);
  options.shared_memory = false;  // a few samples an hour
  return options;
}

}  // namespace

struct RestartNews::Parts {
  Parts(const config::Cell& cell, const config::CellProcess& process)
      : node{node_options(cell, process), dds::load_profiles(cell.profiles)},
        status{node.writer<lifecycle::ProcessStatus>(dds::ServiceTopics{cell.name}.process_status, "state")},
        notice{node.writer<event::Notice>(dds::ServiceTopics{cell.name}.notices, "event")} {
    node.start();
  }
  dds::Node node;
  dds::Writer<lifecycle::ProcessStatus> status;
  dds::Writer<event::Notice> notice;
};

RestartNews::RestartNews(const config::Cell& cell) : cell_{cell} {}
RestartNews::~RestartNews() = default;

template <class Act>
void RestartNews::with_parts(const config::CellProcess& process, Act act) noexcept {
  if (failed_) return;
  try {
    if (!parts_) parts_ = std::make_unique<Parts>(cell_, process);
    act(*parts_);
  } catch (const std::exception& error) {
    failed_ = true;  // this log goes on
    spdlog::warn("the cell cannot be told of restarts: {}", error.what());
  }
}

void RestartNews::be_ready(const config::CellProcess& process) noexcept {
  with_parts(process, [](Parts&) {});
}

void RestartNews::tell(const config::CellProcess& process, const End& end) noexcept {
  const std::string start = end.pause.ns == 0
                                ? "starting it again"
                                : "starting it again in " + shown(end.pause.in_seconds()) + " s";
  base::Stamp at;
  at.time_ns(utc_now().ns);
  with_parts(process, [&](Parts& parts) {
    lifecycle::ProcessStatus status;
    status.cell(cell_.id);
    status.process_id(dds::name_number(process.name));
    status.at(at);
    status.process_name(process.name);
    status.host(process.host);
    status.pid(0);
    status.ended_pid(static_cast<std::uint32_t>(end.process));
    status.rate(1.0 / process.period.in_seconds());
    status.restarts(end.restarts);
    status.last_end(end.how + "; " + start);
    parts.status.write(status);
    event::Notice notice;
    notice.cell(cell_.id);
    notice.component_id(dds::name_number(process.name));
    notice.at(at);
    notice.level(event::SEVERITY_WARNING);
    notice.source(process.name);
    notice.text("ended with " + end.how + "; " + start + " (restart " + std::to_string(end.restarts) + ")");
    parts.notice.write(notice);
  });
  spdlog::warn("process `{}` ended with {}; {} (restart {})", process.name, end.how, start, end.restarts);
}

}  // namespace invar::tools
