#include "core/modbus/map.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/base/limits.hpp"
#include "core/base/shown.hpp"
#include "core/base/unit.hpp"
#include "core/config/yaml.hpp"
#include "core/modbus/codec.hpp"

namespace invar::modbus {

namespace {

using config::Node;

constexpr Range any_span{1e-3, 3600.0};  // [s], of every time in a map

Duration span(const Node& parent, std::string_view key, double otherwise) {
  return Duration::seconds(parent.number(key, "s", any_span, otherwise));
}

std::vector<std::string> names_of(const RegisterMap& map) {
  std::vector<std::string> names;
  for (const auto& reg : map.registers) names.push_back(reg.name);
  return names;
}

/// The register that the text at `node` names; a fault with the nearest name when there is none.
std::optional<std::size_t> named(const RegisterMap& map, const Node& node, const std::string& name) {
  const auto found = map.find(name);
  if (!found) {
    const std::string near = config::nearest(name, names_of(map));
    node.fault("the map has no register `" + name + "`",
               near.empty() ? "name one that stands under `registers`" : "did you mean `" + near + "`?");
  }
  return found;
}

std::optional<std::size_t> named(const RegisterMap& map, const Node& node) {
  const std::string name = node.as_text();
  return name.empty() ? std::nullopt : named(map, node, name);
}

/// A value of `reg` in the device's unit, as SI.
double value_of(const Register& reg, const Node& node) {
  const Unit unit = parse_unit(reg.unit).value_or(Unit{});
  const double value = reg.type == Type::boolean ? node.as_number("1", {0, 1})
                                                 : node.as_number(reg.unit) * unit.factor + unit.offset;
  if (!reg.range.contains(value))
    node.fault("the value is outside the range of `" + reg.name + "`", "choose one inside its range");
  return value;
}

Kind kind_of(const std::string& word) {
  if (word == "coil") return Kind::coil;
  if (word == "discrete") return Kind::discrete;
  return word == "input" ? Kind::input : Kind::holding;
}

Type type_of(const std::string& word) {
  if (word == "bool") return Type::boolean;
  if (word == "int16") return Type::int16;
  if (word == "int32") return Type::int32;
  if (word == "uint32") return Type::uint32;
  return word == "float32" ? Type::float32 : Type::uint16;
}

WordOrder order_of(const std::string& word) {
  if (word == "cdab") return WordOrder::cdab;
  if (word == "badc") return WordOrder::badc;
  return word == "dcba" ? WordOrder::dcba : WordOrder::abcd;
}

bool is_name(const std::string& text) {
  return !text.empty() && std::islower(static_cast<unsigned char>(text.front())) != 0 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '_';
         });
}

void read_shape(const Node& node, const std::string& default_order, Register& reg) {
  reg.kind = kind_of(node.choice("kind", {"holding", "input", "coil", "discrete"}));
  reg.type = type_of(node.choice("type", {"uint16", "int16", "int32", "uint32", "float32", "bool"}));
  if (reg.is_bit() && reg.type != Type::boolean) {
    node["type"].fault("a " + std::string{name_of(reg.kind)} + " holds one bit", "write `type: bool`");
    reg.type = Type::boolean;
  }
  const Node bit = node["bit"];
  if (bit.exists()) {
    reg.bit = static_cast<unsigned>(bit.as_integer(0, 15));
    if (reg.type != Type::boolean || reg.is_bit())
      bit.fault("only a bool in an input or holding register has a bit", "remove `bit`");
  } else if (reg.type == Type::boolean && !reg.is_bit()) {
    node.fault("a bool in a 16-bit register needs its bit", "add `bit: 0` to `bit: 15`");
    reg.bit = 0;
  }
  const Node order = node["word_order"];
  if (order.exists()) {
    reg.word_order = order_of(order.as_choice({"abcd", "cdab", "badc", "dcba"}));
    if (reg.width() != 2) order.fault("only 32-bit types have a word order", "remove `word_order`");
  } else {
    reg.word_order = order_of(default_order);
  }
  reg.address = static_cast<std::uint16_t>(node.integer("address", 0, 65535));
  if (reg.width() == 2 && reg.address == 65535)
    node["address"].fault("the second word would stand beyond 65535", "use 65534 or less");
}

void read_quantity(const config::Yaml& yaml, const Node& node, Register& reg) {
  const Node scale = node["scale"];
  const Node offset = node["offset"];
  const Node unit = node["unit"];
  const Node range = node["range"];
  reg.unit = "1";
  if (reg.type == Type::boolean) {
    for (const Node& extra : {scale, offset, unit, range})
      if (extra.exists()) extra.fault("a bool has no " + extra.key(), "remove it");
    reg.range = {0.0, 1.0};
    return;
  }
  Unit si;
  if (unit.exists()) {
    reg.unit = unit.as_text();
    if (const auto parsed = parse_unit(reg.unit)) {
      si = *parsed;
    } else {
      unit.fault("`" + reg.unit + "` is no unit", "write for example W, degC, kPa, ohm, ms");
      reg.unit = "1";
    }
  }
  const std::size_t before = yaml.fault_count();
  reg.scale = scale.exists() ? scale.as_number("1") : 1.0;
  if (reg.scale == 0.0) {
    if (yaml.fault_count() == before)
      scale.fault("a scale of 0 loses the value", "write how much one count is, for example 0.01");
    reg.scale = 1.0;
  }
  reg.offset = (offset.exists() ? offset.as_number(reg.unit) : 0.0) * si.factor + si.offset;
  reg.scale *= si.factor;
  const Range holds = representable(reg);
  reg.range = holds;
  if (reg.type != Type::float32 && (!std::isfinite(holds.lower) || !std::isfinite(holds.upper)))
    (scale.exists() ? scale : node).fault("the largest count is no finite value", "choose a smaller scale");
  if (!range.exists()) return;
  const Range written = range.as_range(reg.unit);
  reg.range = {written.lower * si.factor + si.offset, written.upper * si.factor + si.offset};
  const double slack = 1e-9 * holds.width();
  if (reg.range.lower < holds.lower - slack || reg.range.upper > holds.upper + slack)
    range.fault("the type with this scale cannot hold the whole range",
                "narrow the range, or choose a wider type or a larger scale");
}

void read_access(const Node& node, Register& reg) {
  const std::string access = node.choice("access", {"read", "write", "read_write"});
  reg.readable = access != "write";
  reg.writable = access != "read";
  const bool has_role = reg.writable;
  if (reg.writable && (reg.kind == Kind::input || reg.kind == Kind::discrete)) {
    node["access"].fault("a register of kind " + std::string{name_of(reg.kind)} + " cannot be written",
                         "write `access: read`, or use holding or coil");
    reg.writable = false;
  }
  if (reg.writable && reg.bit) {
    node["access"].fault("writing one bit would overwrite its neighbours in the word",
                         "write `access: read`, or use a coil");
    reg.writable = false;
  }
  const Node role = node["role"];
  if (has_role) {
    reg.is_actuator = node.choice("role", {"actuator", "setting"}) == "actuator";
  } else if (role.exists()) {
    (void)role.as_choice({"actuator", "setting"});
    role.fault("only a register that is written has a role", "remove `role`");
  }
}

Register read_register(const config::Yaml& yaml, const Node& node, const std::string& default_order) {
  Register reg;
  reg.name = node.key();
  if (!is_name(reg.name)) node.fault("`" + reg.name + "` is no name", "use lower_case_words");
  reg.description = node.text("description", "");
  (void)node["read_back"];  // a known key; read when all registers are known
  read_shape(node, default_order, reg);
  read_quantity(yaml, node, reg);
  read_access(node, reg);
  reg.initial = reg.range.clamp(0.0);
  if (const Node initial = node["initial"]; initial.exists()) reg.initial = value_of(reg, initial);
  return reg;
}

void read_read_backs(const Node& registers, RegisterMap& map, const std::vector<bool>& sound) {
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    Register& reg = map.registers[i];
    const Node node = registers[reg.name];
    const Node read_back = node["read_back"];
    if (!sound[i]) continue;
    if (!read_back.exists()) {
      if (reg.is_actuator)
        node.fault("an actuator without read-back: nobody would see that a write did not arrive",
                   "add `read_back: self`, or the register that shows it");
      continue;
    }
    const std::string name = read_back.as_text();
    if (!reg.writable) {
      read_back.fault("only a register that is written is read back", "remove `read_back`");
      continue;
    }
    const auto shows = name == "self" ? map.find(reg.name) : named(map, read_back, name);
    if (!shows) continue;
    const Register& other = map.registers[*shows];
    if (!other.readable) {
      read_back.fault("`" + other.name + "` cannot be read",
                      "name a register with `access: read_write` or read");
    } else if (!conversion(reg.unit, other.unit)) {
      read_back.fault("`" + other.name + "` does not measure the same", "name a register in " + reg.unit);
    } else {
      reg.read_back = shows;
    }
  }
}

void read_heartbeat(const Node& root, RegisterMap& map, const std::vector<bool>& sound) {
  const Node node = root["heartbeat"];
  if (!node.exists()) {
    for (std::size_t i = 0; i < map.registers.size(); ++i) {
      if (!map.registers[i].is_actuator || !sound[i]) continue;
      root["registers"][map.registers[i].name].fault(
          "an actuator in a map without heartbeat keeps on when its master dies",
          "add `heartbeat:` to the map");
    }
    return;
  }
  Heartbeat beat;
  const Node reg = node.required("register");
  const std::size_t nowhere = map.registers.size();
  const std::size_t index = reg.exists() ? named(map, reg).value_or(nowhere) : nowhere;
  beat.timeout = span(node, "timeout", 1.0);
  beat.period = span(node, "period", beat.timeout.in_seconds() / 5);
  beat.refresh_within = span(node, "refresh_within", beat.timeout.in_seconds() / 2);
  if (!node.has("timeout")) (void)node.required("timeout");
  if (beat.period * 2 > beat.timeout)
    node["period"].fault("the device would time out when one heartbeat is late",
                         "make `period` at most half of `timeout`");
  if (const Node setting = node["timeout_register"]; setting.exists()) {
    beat.timeout_setting = named(map, setting);
    if (beat.timeout_setting && !conversion(map.registers[*beat.timeout_setting].unit, "s")) {
      setting.fault("`" + map.registers[*beat.timeout_setting].name + "` is no time",
                    "name a register in s or ms");
      beat.timeout_setting.reset();
    } else if (beat.timeout_setting && sound[*beat.timeout_setting]) {
      const Register& target = map.registers[*beat.timeout_setting];
      if (!target.range.contains(beat.timeout.in_seconds()))
        node["timeout"].fault(
            "is outside the range of `" + target.name + "`, which is to hold it",
            "choose one between " + shown(target.range.lower) + " and " + shown(target.range.upper) + " s");
    }
  }
  if (index == nowhere || !sound[index]) return;
  const Register& target = map.registers[index];
  if (!target.writable || target.is_actuator || target.type == Type::float32 || target.unit != "1") {
    reg.fault("`" + target.name + "` cannot be counted up",
              "name a writable `role: setting` register or coil without unit");
    return;
  }
  beat.reg = index;
  map.heartbeat = beat;
}

/// Without a master an actuator is off: at 0, but for a temperature, which has no zero of its own.
bool switches_on(const Register& reg, double value) {
  return value != 0.0 && reg.range.contains(0.0) && !conversion(reg.unit, "degC");
}

void read_comm_loss(const config::Yaml& yaml, const Node& root, RegisterMap& map,
                    const std::vector<bool>& sound) {
  const Node node = root["comm_loss"];
  std::vector<bool> decided(map.registers.size());
  const auto decide = [&](const Node& where, std::size_t index) {
    if (!sound[index]) return;
    if (!map.registers[index].writable)
      where.fault("`" + map.registers[index].name + "` is not commanded", "name a writable register");
    else if (decided[index])
      where.fault("`" + map.registers[index].name + "` is both set and held", "keep one of them");
    decided[index] = true;
  };
  for (const Node& entry : node["set"].map()) {
    const auto found = named(map, entry, entry.key());
    if (!found) continue;
    const Register& reg = map.registers[*found];
    const std::size_t before = yaml.fault_count();
    decide(entry, *found);
    const double value = value_of(reg, entry);
    const bool reasoned = entry.is_map() && !entry.text("because", "").empty();
    if (yaml.fault_count() == before && reg.is_actuator && switches_on(reg, value) && !reasoned)
      entry.fault("switches `" + reg.name + "` on when the master is lost",
                  "set it to 0; where on is its safe state, as a vent's, write {value: ..., because: why}");
    map.comm_loss.set.push_back({*found, value});
  }
  for (const Node& entry : node["hold"].list()) {
    const auto found = named(map, entry);
    if (!found) continue;
    decide(entry, *found);
    map.comm_loss.hold.push_back(*found);
  }
  if (const Node flag = node["flag"]; flag.exists()) {
    map.comm_loss.flag = named(map, flag);
    if (map.comm_loss.flag) {
      const Register& reg = map.registers[*map.comm_loss.flag];
      if (reg.type != Type::boolean || reg.writable)
        flag.fault("`" + reg.name + "` cannot show the loss", "name a bool with `access: read`");
    }
  }
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    if (!map.registers[i].is_actuator || decided[i] || !sound[i]) continue;
    root["registers"][map.registers[i].name].fault(
        "an actuator without comm-loss action",
        "name it under `comm_loss.set` with its safe value, or under `comm_loss.hold`");
  }
}

void check_overlaps(const Node& registers, const RegisterMap& map, const std::vector<bool>& sound) {
  const auto& all = map.registers;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (all[i].kind != all[j].kind || !sound[i] || !sound[j]) continue;
      const unsigned begin = std::max(all[i].address, all[j].address);
      const unsigned end = std::min(all[i].address + all[i].width(), all[j].address + all[j].width());
      const bool other_bits = all[i].bit && all[j].bit && *all[i].bit != *all[j].bit;
      if (begin < end && !other_bits)
        registers[all[i].name].fault("overlaps `" + all[j].name + "` at " +
                                         std::string{name_of(all[i].kind)} + " " + std::to_string(begin),
                                     "move one of them");
    }
  }
}

RegisterMap read(const config::Yaml& yaml) {
  const Node root = yaml.root();
  RegisterMap map;
  (void)root.integer("invar_modbus_map", 1, 1);
  map.device = root.text("device");
  map.description = root.text("description", "");
  map.unit = static_cast<std::uint8_t>(root.integer("unit", 1, 255, 1));
  // A device with an address of its own often answers at 255; the others are reserved.
  if (map.unit > 247 && map.unit != 255)
    root["unit"].fault("is no unit of a device", "use 1 to 247, or 255 where it has none");
  map.gaps_readable = root.choice("gaps", {"refused", "readable"}, "refused") == "readable";
  map.max_registers =
      static_cast<unsigned>(root.integer("max_registers", 1, largest_word_read, largest_word_read));
  map.max_bits = static_cast<unsigned>(root.integer("max_bits", 1, largest_bit_read, largest_bit_read));
  const std::string order = root.choice("word_order", {"abcd", "cdab", "badc", "dcba"}, "abcd");
  map.poll = span(root, "poll", 0.1);
  const Node timeouts = root["timeouts"];
  map.answer_timeout = span(timeouts, "answer", 0.25);
  map.write_deadline = span(timeouts, "write", 1.0);
  map.read_back_deadline = span(timeouts, "read_back", 0.5);
  const Duration stale = span(timeouts, "stale", 3.0 * map.poll.in_seconds());
  if (stale < map.poll * 2)
    (timeouts.has("stale") ? timeouts["stale"] : root["poll"])
        .fault("values would be stale between two polls", "make `timeouts.stale` at least twice `poll`");
  else if (map.answer_timeout > stale && (timeouts.has("answer") || timeouts.has("stale")))
    timeouts[timeouts.has("answer") ? "answer" : "stale"].fault(
        "a value would be stale before its answer is late",
        "make `timeouts.answer` at most `timeouts.stale`");

  const Node registers = root.required("registers");
  if (registers.map().size() > limits::map_registers) {
    registers.fault("has more than " + std::to_string(limits::map_registers) + " registers",
                    "make several maps of it");
    yaml.finish();
  }
  std::vector<bool> sound;  // what hangs on a wrong register is not reported a second time
  for (const Node& node : registers.map()) {
    const std::size_t before = yaml.fault_count();
    map.registers.push_back(read_register(yaml, node, order));
    map.registers.back().stale_after = stale;
    sound.push_back(yaml.fault_count() == before);
  }
  for (const Fault& fault : yaml.faults())  // keys that nobody asked for are among them
    for (std::size_t i = 0; i < sound.size(); ++i)
      if (fault.where.find(": registers." + map.registers[i].name + ".") != std::string::npos)
        sound[i] = false;
  if (registers.is_map() && map.registers.empty())
    registers.fault("no registers", "write `name: {address: 0, kind: holding, type: uint16, access: read}`");
  check_overlaps(registers, map, sound);
  for (const Register& reg : map.registers)
    if (reg.width() > map.max_registers)
      root["max_registers"].fault("`" + reg.name + "` stands in two registers, which must be read at once",
                                  "allow 2, or name two 16-bit registers");
  read_read_backs(registers, map, sound);
  const bool reads_back = std::any_of(map.registers.begin(), map.registers.end(),
                                      [](const Register& reg) { return reg.read_back.has_value(); });
  if (reads_back && map.read_back_deadline < map.poll)
    (timeouts.has("read_back") ? timeouts["read_back"] : root["poll"])
        .fault("a read-back would be given up before the next poll can show it",
               "make `timeouts.read_back` at least `poll`");
  read_heartbeat(root, map, sound);
  read_comm_loss(yaml, root, map, sound);
  yaml.finish();
  return map;
}

}  // namespace

std::string_view name_of(Kind kind) {
  switch (kind) {
    case Kind::coil:
      return "coil";
    case Kind::discrete:
      return "discrete";
    case Kind::input:
      return "input";
    case Kind::holding:
      break;
  }
  return "holding";
}

std::string_view name_of(Type type) {
  switch (type) {
    case Type::boolean:
      return "bool";
    case Type::int16:
      return "int16";
    case Type::uint16:
      return "uint16";
    case Type::int32:
      return "int32";
    case Type::uint32:
      return "uint32";
    case Type::float32:
      break;
  }
  return "float32";
}

std::optional<std::size_t> RegisterMap::find(std::string_view name) const {
  const auto found =
      std::find_if(registers.begin(), registers.end(), [&](const Register& reg) { return reg.name == name; });
  if (found == registers.end()) return std::nullopt;
  return static_cast<std::size_t>(found - registers.begin());
}

RegisterMap load_map(const std::filesystem::path& file) { return read(config::Yaml::load(file)); }
RegisterMap parse_map(const std::string& text, const std::string& name) {
  return read(config::Yaml::parse(text, name));
}

}  // namespace invar::modbus
