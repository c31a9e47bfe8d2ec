// Result: a value, or the small enum that says why there is none. For failures of the world, not of the
// caller.
#pragma once

#include <utility>
#include <variant>

#include "core/base/contract.hpp"

namespace invar {

/// Either a T or an Error (a small enum). C++20 has no std::expected; this is the part of it that we use.
template <class T, class Error>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_{std::in_place_index<0>, std::move(value)} {}  // NOLINT: implicit on purpose
  Result(Error error) : content_{std::in_place_index<1>, error} {}         // NOLINT: implicit on purpose

  [[nodiscard]] bool ok() const { return content_.index() == 0; }
  explicit operator bool() const { return ok(); }

  /// The value. Precondition: ok().
  [[nodiscard]] const T& value() const {
    INVAR_EXPECTS(ok());
    return std::get<0>(content_);
  }
  [[nodiscard]] T& value() {
    INVAR_EXPECTS(ok());
    return std::get<0>(content_);
  }
  /// The reason. Precondition: not ok().
  [[nodiscard]] Error error() const {
    INVAR_EXPECTS(!ok());
    return std::get<1>(content_);
  }

 private:
  std::variant<T, Error> content_;
};

}  // namespace invar
