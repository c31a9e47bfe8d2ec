// Notices: what a component says to people.
#pragma once

#include "core/component/component.hpp"
#include "idl/event.h"

namespace invar {

/// The port `notices` of a component. Set-up of the port allocates, saying does not.
class Notices {
 public:
  explicit Notices(Component& owner) : owner_{owner}, output_{owner, "notices", "event"} {}

  void say(event::Severity level, const char* text) noexcept {
    event::Notice notice;
    owner_.stamp(notice);
    notice.component_id(owner_.id);
    notice.level(level);
    notice.source(owner_.name.c_str());
    notice.text(text);
    output_.write(notice);
  }

 private:
  const Component& owner_;
  Output<event::Notice> output_;
};

}  // namespace invar
