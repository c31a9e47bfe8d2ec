#include "core/recording/cdr.hpp"

#include <algorithm>
#include <optional>

#include "core/base/contract.hpp"
#include "core/base/limits.hpp"

namespace invar::recording {

namespace {

constexpr std::size_t encapsulation = 4;

class Decoder {
 public:
  Decoder(ByteView body, std::endian order) : body_{body}, swapped_{order == std::endian::big} {}

  /// False at the first fault; fault() tells which.
  bool read(const Type& type, Value& value) {
    value.type = &type;
    switch (type.kind) {
      case Kind::boolean: {
        const auto byte = number<std::uint8_t>();
        if (byte > 1) return fail(CdrFault::boolean);
        value.content = byte == 1;
        return ok();
      }
      case Kind::character:
        value.content = std::string(1, static_cast<char>(number<std::uint8_t>()));
        return ok();
      case Kind::octet:
        value.content = std::uint64_t{number<std::uint8_t>()};
        return ok();
      case Kind::uint16:
        value.content = std::uint64_t{number<std::uint16_t>()};
        return ok();
      case Kind::uint32:
        value.content = std::uint64_t{number<std::uint32_t>()};
        return ok();
      case Kind::uint64:
        value.content = number<std::uint64_t>();
        return ok();
      case Kind::int8:
        value.content = std::int64_t{static_cast<std::int8_t>(number<std::uint8_t>())};
        return ok();
      case Kind::int16:
        value.content = std::int64_t{static_cast<std::int16_t>(number<std::uint16_t>())};
        return ok();
      case Kind::enumeration:
      case Kind::int32:
        value.content = std::int64_t{static_cast<std::int32_t>(number<std::uint32_t>())};
        return ok();
      case Kind::int64:
        value.content = static_cast<std::int64_t>(number<std::uint64_t>());
        return ok();
      case Kind::float32:
        value.content = static_cast<double>(std::bit_cast<float>(number<std::uint32_t>()));
        return ok();
      case Kind::float64:
        value.content = std::bit_cast<double>(number<std::uint64_t>());
        return ok();
      case Kind::string:
        return text(type, value);
      case Kind::sequence: {
        const auto length = number<std::uint32_t>();
        if (type.bound != 0 && length > type.bound) return fail(CdrFault::bound);
        return elements(*type.element, length, value);
      }
      case Kind::array:
        return elements(*type.element, type.bound, value);
      case Kind::structure: {
        if (!takes(type.members.size())) return fail(CdrFault::many);
        std::vector<Value> members(type.members.size());
        for (std::size_t i = 0; i < members.size(); ++i)
          if (!read(*type.members[i].type, members[i])) return false;
        value.content = std::move(members);
        return true;
      }
    }
    return false;
  }

  [[nodiscard]] bool ok() const { return !fault_; }
  [[nodiscard]] CdrFault fault() const { return *fault_; }
  [[nodiscard]] std::size_t left() const { return body_.size() - at_; }

 private:
  bool fail(CdrFault fault) {
    if (!fault_) fault_ = fault;
    return false;
  }

  template <std::unsigned_integral T>
  T number() {
    const std::size_t aligned = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (fault_ || aligned + sizeof(T) > body_.size()) {
      fail(CdrFault::too_short);
      return 0;
    }
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      const std::size_t significance = swapped_ ? sizeof(T) - 1 - i : i;
      value |= std::uint64_t{body_[aligned + i]} << (8U * significance);
    }
    at_ = aligned + sizeof(T);
    return static_cast<T>(value);
  }

  ByteView bytes(std::size_t count) {
    if (fault_ || count > left()) {
      fail(CdrFault::too_short);
      return {};
    }
    at_ += count;
    return body_.subspan(at_ - count, count);
  }

  bool text(const Type& type, Value& value) {
    const auto length = number<std::uint32_t>();  // with the zero byte; some writers say 0 for an empty text
    const ByteView characters = bytes(length);
    if (!ok()) return false;
    if (length > 0 && characters.back() != 0) return fail(CdrFault::text);
    const std::size_t size = length > 0 ? length - 1U : 0U;
    if (type.bound != 0 && size > type.bound) return fail(CdrFault::bound);
    value.content = std::string{characters.begin(), characters.begin() + static_cast<std::ptrdiff_t>(size)};
    return true;
  }

  bool elements(const Type& element, std::uint32_t length, Value& value) {
    if (!ok()) return false;
    if (length > left()) return fail(CdrFault::too_short);  // every element has at least one byte
    if (element.kind == Kind::octet) {
      const ByteView all = bytes(length);
      value.content = Bytes{all.begin(), all.end()};
      return true;
    }
    if (!takes(length)) return fail(CdrFault::many);
    std::vector<Value> list(length);
    for (Value& each : list)
      if (!read(element, each)) return false;
    value.content = std::move(list);
    return true;
  }

  /// Each value takes many times the memory of its bytes.
  bool takes(std::size_t values) {
    values_ += values;
    return values_ <= limits::message_values;
  }

  ByteView body_;
  bool swapped_;
  std::size_t at_ = 0, values_ = 0;
  std::optional<CdrFault> fault_;
};

class Encoder {
 public:
  explicit Encoder(std::endian order) : swapped_{order == std::endian::big} {
    out_ = {0, static_cast<std::uint8_t>(swapped_ ? 0 : 1), 0, 0};
  }

  void write(const Value& value) {
    INVAR_EXPECTS(value.type != nullptr);
    const Type& type = *value.type;
    switch (type.kind) {
      case Kind::boolean:
        number(static_cast<std::uint8_t>(get<bool>(value) ? 1 : 0));
        break;
      case Kind::character:
        number(static_cast<std::uint8_t>(get<std::string>(value).at(0)));
        break;
      case Kind::octet:
        number(static_cast<std::uint8_t>(get<std::uint64_t>(value)));
        break;
      case Kind::uint16:
        number(static_cast<std::uint16_t>(get<std::uint64_t>(value)));
        break;
      case Kind::uint32:
        number(static_cast<std::uint32_t>(get<std::uint64_t>(value)));
        break;
      case Kind::uint64:
        number(get<std::uint64_t>(value));
        break;
      case Kind::int8:
        number(static_cast<std::uint8_t>(get<std::int64_t>(value)));
        break;
      case Kind::int16:
        number(static_cast<std::uint16_t>(get<std::int64_t>(value)));
        break;
      case Kind::enumeration:
      case Kind::int32:
        number(static_cast<std::uint32_t>(get<std::int64_t>(value)));
        break;
      case Kind::int64:
        number(static_cast<std::uint64_t>(get<std::int64_t>(value)));
        break;
      case Kind::float32:
        number(std::bit_cast<std::uint32_t>(static_cast<float>(get<double>(value))));
        break;
      case Kind::float64:
        number(std::bit_cast<std::uint64_t>(get<double>(value)));
        break;
      case Kind::string: {
        const auto& text = get<std::string>(value);
        INVAR_EXPECTS(type.bound == 0 || text.size() <= type.bound, text.size(), type.bound);
        number(static_cast<std::uint32_t>(text.size() + 1));
        out_.insert(out_.end(), text.begin(), text.end());
        out_.push_back(0);
        break;
      }
      case Kind::sequence:
      case Kind::array:
        elements(type, value);
        break;
      case Kind::structure: {
        const auto& members = get<std::vector<Value>>(value);
        INVAR_EXPECTS(members.size() == type.members.size(), members.size(), type.name);
        for (const Value& member : members) write(member);
        break;
      }
    }
  }

  Bytes take() { return std::move(out_); }

 private:
  template <class T>
  static const T& get(const Value& value) {
    const T* content = std::get_if<T>(&value.content);
    INVAR_EXPECTS(content != nullptr, static_cast<int>(value.type->kind), value.content.index());
    return *content;
  }

  template <std::unsigned_integral T>
  void number(T value) {
    while ((out_.size() - encapsulation) % sizeof(T) != 0) out_.push_back(0);
    std::array<std::uint8_t, sizeof(T)> bytes;
    store(bytes.data(), value);
    if (swapped_) std::reverse(bytes.begin(), bytes.end());
    out_.insert(out_.end(), bytes.begin(), bytes.end());
  }

  void elements(const Type& type, const Value& value) {
    const auto* octets = std::get_if<Bytes>(&value.content);
    const std::size_t count = octets != nullptr ? octets->size() : get<std::vector<Value>>(value).size();
    if (type.kind == Kind::sequence) {
      INVAR_EXPECTS(type.bound == 0 || count <= type.bound, count, type.bound);
      number(static_cast<std::uint32_t>(count));
    } else {
      INVAR_EXPECTS(count == type.bound, count, type.bound);
    }
    if (octets != nullptr) {
      put(out_, ByteView{*octets});
    } else {
      for (const Value& each : get<std::vector<Value>>(value)) write(each);
    }
  }

  bool swapped_;
  Bytes out_;
};

}  // namespace

std::string_view sentence(CdrFault fault) {
  switch (fault) {
    case CdrFault::encapsulation:
      return "the payload does not begin as plain CDR";
    case CdrFault::too_short:
      return "the payload ends before its type does";
    case CdrFault::too_long:
      return "the payload goes on after its type ends";
    case CdrFault::boolean:
      return "a boolean is neither 0 nor 1";
    case CdrFault::text:
      return "a string does not end with a zero byte";
    case CdrFault::bound:
      return "a string or sequence is longer than its type allows";
    case CdrFault::many:
      return "it holds more than a million values";
  }
  return "";
}

Result<Value, CdrFault> decode(const Type& type, ByteView payload) {
  if (payload.size() < encapsulation || payload[0] != 0 || payload[1] > 1) return CdrFault::encapsulation;
  Decoder decoder{payload.subspan(encapsulation), payload[1] == 1 ? std::endian::little : std::endian::big};
  Value value;
  if (!decoder.read(type, value)) return decoder.fault();
  if (decoder.left() > 3) return CdrFault::too_long;
  return value;
}

Bytes encode(const Value& value, std::endian order) {
  Encoder encoder{order};
  encoder.write(value);
  return encoder.take();
}

}  // namespace invar::recording
