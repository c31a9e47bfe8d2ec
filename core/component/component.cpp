#include "core/component/component.hpp"

namespace invar {

Port::Port(Component& owner, std::string_view name, Direction direction, std::type_index type)
    : owner_{owner}, name_{name}, direction_{direction}, type_{type} {
  owner.ports_.push_back(this);
}

Port* Component::find_port(std::string_view port_name) const {
  for (Port* port : ports_)
    if (port->name() == port_name) return port;
  return nullptr;
}

bool Component::input_lost(const InputPort&, const Tick&) noexcept { return false; }

}  // namespace invar
