#include "core/component/component.hpp"

namespace invar {

Port::Port(Component& owner, std::string_view name, Direction direction, std::type_index type)
    : owner_{owner}, name_{name}, direction_{direction}, type_{type} {
  owner.ports_.push_back(this);
}

bool Component::input_lost(const InputPort&, const Tick&) noexcept { return false; }

}  // namespace invar
