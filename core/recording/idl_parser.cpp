#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <set>

#include "core/base/fault.hpp"
#include "core/base/limits.hpp"
#include "core/recording/idl_lexer.hpp"
#include "core/recording/idl_type.hpp"

namespace invar::recording {

namespace {

constexpr int deepest = 64;  // of modules and of sequences within sequences

const std::map<std::string_view, Kind>& primitives() {
  static const std::map<std::string_view, Kind> table{
      {"boolean", Kind::boolean}, {"char", Kind::character}, {"octet", Kind::octet},   {"int8", Kind::int8},
      {"uint8", Kind::octet},     {"int16", Kind::int16},    {"uint16", Kind::uint16}, {"int32", Kind::int32},
      {"uint32", Kind::uint32},   {"int64", Kind::int64},    {"uint64", Kind::uint64}, {"short", Kind::int16},
      {"long", Kind::int32},      {"float", Kind::float32},  {"double", Kind::float64}};
  return table;
}

/// What the annotations before a declaration say.
struct Annotations {
  std::string unit;
  bool key = false;
  std::optional<std::int64_t> value;
};

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : name_{name}, tokens_{idl_tokens(text, name)} {}

  IdlSchema all() {
    while (now().kind != IdlToken::Kind::end) definition(0);
    return std::move(schema_);
  }

 private:
  [[noreturn]] void fail(const std::string& what, const std::string& mend) const {
    throw InputError{name_ + ":" + std::to_string(now().line), what, mend};
  }
  [[noreturn]] void unsupported(const std::string& what) const {
    fail(what + " cannot be carried",
         "keep to structures, enumerations, arrays, sequences, strings and numbers");
  }

  [[nodiscard]] const IdlToken& now() const { return tokens_[at_]; }
  bool accept(std::string_view sign) {
    if (now().kind == IdlToken::Kind::end || now().kind == IdlToken::Kind::text || now().text != sign)
      return false;
    ++at_;
    return true;
  }
  void expect(std::string_view sign) {
    if (!accept(sign))
      fail("`" + std::string{sign} + "` is missing before `" + std::string{now().text} + "`", "write it");
  }
  std::string name() {
    if (now().kind != IdlToken::Kind::name)
      fail("a name is missing before `" + std::string{now().text} + "`", "write it");
    return std::string{tokens_[at_++].text};
  }

  [[nodiscard]] std::string scoped(const std::string& name) const {
    std::string full = scope_.empty() ? name : scope_ + "::" + name;
    if (full.size() > limits::idl_name) fail("a name with its modules is too long", "shorten it");
    return full;
  }
  /// The type with its size and depth, which are bounded: whoever decodes it or lays it out walks over all of it.
  TypePointer sized(Type type) {
    if (type.element != nullptr) {
      const bool one = type.kind == Kind::sequence || type.element->kind == Kind::octet;
      type.values = one ? 1 : type.element->values * type.bound;
      type.depth = type.element->depth + 1;
    }
    if (type.kind == Kind::structure) type.values = 0;
    for (const Member& member : type.members) {
      type.values += member.type->values;
      type.depth = std::max(type.depth, member.type->depth + 1);
    }
    if (type.values > limits::idl_values)
      fail("a type has more than " + std::to_string(limits::idl_values) + " values, arrays multiplied out",
           "make its arrays shorter, or sequences of them");
    if (type.depth > limits::idl_depth)
      fail("types are nested more than " + std::to_string(limits::idl_depth) + " deep", "nest them less");
    return std::make_shared<Type>(std::move(type));
  }
  void declare(const std::string& full) {
    if (!declared_.insert(full).second) fail("`" + full + "` is defined twice", "keep one of them");
  }

  void definition(int depth) {
    const Annotations annotations = annotation_list();
    if (accept("module")) {
      if (depth >= deepest) fail("modules are nested too deep", "take fewer");
      const std::string outer = scope_;
      scope_ = scoped(name());
      expect("{");
      while (!accept("}")) definition(depth + 1);
      scope_ = outer;
    } else if (accept("struct")) {
      structure();
    } else if (accept("enum")) {
      enumeration();
    } else if (accept("typedef")) {
      const TypePointer type = type_spec(0);
      do {
        const std::string full = scoped(name());
        declare(full);
        aliases_[full] = dimensions(type);
      } while (accept(","));
    } else if (accept("const")) {
      constant();
    } else {
      unsupported("`" + std::string{now().text} + "`");
    }
    expect(";");
  }

  Annotations annotation_list() {
    Annotations found;
    while (accept("@")) {
      const std::string what = scoped_name();
      std::string argument;
      if (accept("(")) {
        if (now().kind == IdlToken::Kind::name && tokens_[at_ + 1].text == "=") at_ += 2;
        for (int open = 1; open > 0; ++at_) {
          if (now().kind == IdlToken::Kind::end) fail("an annotation is not closed", "write `)`");
          if (now().kind == IdlToken::Kind::sign) open += now().text == "(" ? 1 : now().text == ")" ? -1 : 0;
          if (open > 0) argument += now().text;
        }
      }
      if (argument.size() > limits::unit && what == "unit") fail("a unit is too long", "shorten it");
      if (what == "unit") found.unit = argument;
      if (what == "key") found.key = argument.empty() || argument == "TRUE" || argument == "true";
      if (what == "value") found.value = number(argument);
      if (what == "mutable" || what == "optional" || what == "bit_bound" || argument == "MUTABLE")
        unsupported("@" + what + (argument.empty() ? "" : "(" + argument + ")"));
    }
    return found;
  }

  void structure() {
    auto type = std::make_shared<Type>();
    type->kind = Kind::structure;
    type->name = scoped(name());
    declare(type->name);
    if (now().text == ":") unsupported("inheritance");
    if (now().text == ";") unsupported("a forward declaration");
    expect("{");
    std::set<std::string> names;
    while (!accept("}")) {
      const Annotations annotations = annotation_list();
      const TypePointer member = type_spec(0);
      do {
        const std::string member_name = name();
        if (!names.insert(member_name).second)
          fail("`" + type->name + "` has two members `" + member_name + "`", "rename one");
        type->members.push_back({member_name, dimensions(member), annotations.unit, annotations.key});
      } while (accept(","));
      expect(";");
    }
    if (type->members.empty()) unsupported("a structure without members");
    const std::string full = type->name;
    schema_.types[full] = sized(std::move(*type));
  }

  void enumeration() {
    auto type = std::make_shared<Type>();
    type->kind = Kind::enumeration;
    type->name = scoped(name());
    declare(type->name);
    expect("{");
    std::int64_t value = 0;
    do {
      const Annotations annotations = annotation_list();
      value = annotations.value.value_or(value);
      if (value < std::numeric_limits<std::int32_t>::min() ||
          value > std::numeric_limits<std::int32_t>::max())
        fail("an enumerator's value does not fit 32 bits", "take a smaller one");
      type->enumerators.emplace_back(name(), static_cast<std::int32_t>(value++));
    } while (accept(",") && now().text != "}");
    expect("}");
    schema_.types[type->name] = std::move(type);
  }

  void constant() {
    if (!accept("string")) (void)type_spec(0);
    const std::string full = scoped(name());
    declare(full);
    expect("=");
    const std::size_t begin = at_;
    while (now().text != ";" && now().kind != IdlToken::Kind::end) ++at_;
    // Only whole numbers can be lengths; other constants are of no use here.
    if (at_ == begin + 1) constants_[full] = number(tokens_[begin].text).value_or(-1);
  }

  std::string scoped_name() {
    std::string full = accept("::") ? "::" : "";
    full += name();
    while (accept("::")) full += "::" + name();
    return full;
  }

  /// Looks a name up from the innermost scope outwards.
  template <class Table>
  [[nodiscard]] auto look_up(const Table& table, const std::string& name) const -> const
      typename Table::mapped_type* {
    if (name.starts_with("::")) {
      const auto found = table.find(name.substr(2));
      return found == table.end() ? nullptr : &found->second;
    }
    for (std::string scope = scope_;;) {
      const auto found = table.find(scope.empty() ? name : scope + "::" + name);
      if (found != table.end()) return &found->second;
      if (scope.empty()) return nullptr;
      const auto cut = scope.rfind("::");
      scope.resize(cut == std::string::npos ? 0 : cut);
    }
  }

  static std::optional<std::int64_t> number(std::string_view digits) {
    int base = 10;
    if (digits.starts_with("0x") || digits.starts_with("0X")) {
      base = 16;
      digits.remove_prefix(2);
    } else if (digits.size() > 1 && digits.front() == '0') {
      base = 8;
    }
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, base);
    if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
    return value;
  }

  /// A length: a whole number or the name of a constant.
  std::uint32_t length() {
    std::optional<std::int64_t> value;
    if (now().kind == IdlToken::Kind::number) {
      value = number(tokens_[at_++].text);
    } else {
      const std::string constant = scoped_name();
      const auto* found = look_up(constants_, constant);
      if (found == nullptr) fail("there is no constant `" + constant + "`", "define it before");
      value = *found;
    }
    if (!value || *value < 1 || *value > std::numeric_limits<std::uint32_t>::max())
      fail("a length is no whole number from 1 to 4294967295", "write one");
    return static_cast<std::uint32_t>(*value);
  }

  TypePointer dimensions(TypePointer element) {
    std::vector<std::uint32_t> lengths;
    while (accept("[")) {
      lengths.push_back(length());
      expect("]");
      if (lengths.size() > static_cast<std::size_t>(deepest))
        fail("an array has too many dimensions", "take fewer");
    }
    for (auto each = lengths.rbegin(); each != lengths.rend(); ++each)
      element = sized({Kind::array, "", *each, std::move(element)});
    return element;
  }

  TypePointer primitive(Kind kind) { return std::make_shared<Type>(Type{kind, ""}); }

  TypePointer type_spec(int depth) {
    if (depth >= deepest) fail("sequences are nested too deep", "take fewer");
    if (accept("unsigned")) {
      if (accept("short")) return primitive(Kind::uint16);
      expect("long");
      return primitive(accept("long") ? Kind::uint64 : Kind::uint32);
    }
    if (accept("long")) {
      if (now().text == "double") unsupported("`long double`");
      return primitive(accept("long") ? Kind::int64 : Kind::int32);
    }
    if (accept("string")) {
      std::uint32_t bound = 0;
      if (accept("<")) {
        bound = length();
        expect(">");
      }
      return std::make_shared<Type>(Type{Kind::string, "", bound});
    }
    if (accept("sequence")) {
      expect("<");
      TypePointer element = type_spec(depth + 1);
      const std::uint32_t bound = accept(",") ? length() : 0;
      expect(">");
      return sized({Kind::sequence, "", bound, std::move(element)});
    }
    if (const auto found = primitives().find(now().text);
        now().kind == IdlToken::Kind::name && found != primitives().end()) {
      ++at_;
      return primitive(found->second);
    }
    const std::string full = scoped_name();
    if (const auto* type = look_up(schema_.types, full)) return *type;
    if (const auto* alias = look_up(aliases_, full)) return *alias;
    fail("there is no type `" + full + "`", "define it before it is used, or take one that CDR here carries");
  }

  const std::string& name_;
  std::vector<IdlToken> tokens_;
  std::size_t at_ = 0;
  std::string scope_;
  IdlSchema schema_;
  std::map<std::string, TypePointer> aliases_;
  std::map<std::string, std::int64_t> constants_;
  std::set<std::string> declared_;
};

}  // namespace

IdlSchema parse_idl(std::string_view text, const std::string& name) {
  if (text.size() > limits::idl_text)
    throw InputError{name, "has " + std::to_string(text.size()) + " bytes of IDL",
                     "keep to " + std::to_string(limits::idl_text)};
  return Parser{text, name}.all();
}

}  // namespace invar::recording
