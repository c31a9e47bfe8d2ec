#include "core/dds/typed_wire.hpp"

namespace invar::dds {

WireTypes::WireTypes() {
#define INVAR_ADD(T) add(std::make_unique<TypedWire<T, T##PubSubType>>());
  INVAR_IDL_TYPES(INVAR_ADD)
#undef INVAR_ADD
}

WireTypes& WireTypes::all() {
  static WireTypes types;
  return types;
}

void WireTypes::add(std::unique_ptr<WireType> type) {
  if (find(type->index()) == nullptr) types_.push_back(std::move(type));
}

const WireType* WireTypes::find(std::type_index index) const {
  for (const auto& type : types_)
    if (type->index() == index) return type.get();
  return nullptr;
}

const WireType* WireTypes::find(std::string_view name) const {
  for (const auto& type : types_)
    if (type->name() == name) return type.get();
  return nullptr;
}

std::vector<std::string> WireTypes::names() const {
  std::vector<std::string> names;
  for (const auto& type : types_) names.push_back(type->name());
  return names;
}

}  // namespace invar::dds
