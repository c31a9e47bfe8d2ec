// IDL texts and CDR payloads, held against Fast CDR and the code that Fast DDS's generator makes of the same IDL.
#include "core/recording/cdr.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/base/fault.hpp"
#include "core/recording/columns.hpp"
#include "core/recording/type_book.hpp"
#include "core/recording/value_json.hpp"
#include "tests/unit/recording/everything.hpp"

namespace invar::recording {
namespace {

using eprosima::fastcdr::Cdr;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TypePointer everything() {
  std::ifstream file{INVAR_TEST_DATA "/recording/everything.idl"};
  const std::string text{std::istreambuf_iterator<char>{file}, {}};
  return parse_idl(text, "everything.idl").find("probe::Everything");
}

double number(const Value& value, const std::string& path) {
  const Value* found = value.at(path);
  return found == nullptr ? std::nan("") : found->number().value_or(std::nan(""));
}
std::string text(const Value& value, const std::string& path) {
  const Value* found = value.at(path);
  return found == nullptr ? "absent" : std::get<std::string>(found->content);
}

class EachOrder : public ::testing::TestWithParam<Cdr::Endianness> {
 protected:
  EachOrder() { std::cout << "seed " << seed << '\n'; }
  const std::uint64_t seed = std::random_device{}();
  std::mt19937_64 random{seed};
  TypePointer type = everything();
};
INSTANTIATE_TEST_SUITE_P(Cdr, EachOrder, ::testing::Values(Cdr::LITTLE_ENDIANNESS, Cdr::BIG_ENDIANNESS),
                         [](const auto& it) {
                           return it.param == Cdr::LITTLE_ENDIANNESS ? "Little" : "Big";
                         });

TEST_P(EachOrder, ReadsWhatFastCdrWrote) {
  for (int round = 0; round < 200; ++round) {
    const auto sample = random_sample(random);
    const auto decoded = decode(*type, serialised(sample, GetParam()));
    ASSERT_TRUE(decoded.ok()) << sentence(decoded.error());
    const Value& value = decoded.value();
    EXPECT_EQ(number(value, "id"), sample.id());
    EXPECT_EQ(number(value, "flag"), sample.flag() ? 1.0 : 0.0);
    EXPECT_EQ(text(value, "letter"), std::string(1, sample.letter()));
    EXPECT_EQ(number(value, "mask"), sample.mask());
    EXPECT_EQ(number(value, "tiny"), sample.tiny());
    EXPECT_EQ(number(value, "utiny"), sample.utiny());
    EXPECT_EQ(number(value, "small"), sample.small());
    EXPECT_EQ(number(value, "usmall"), sample.usmall());
    EXPECT_EQ(number(value, "medium"), sample.medium());
    EXPECT_EQ(number(value, "umedium"), sample.umedium());
    EXPECT_EQ(std::get<std::int64_t>(value.at("large")->content), sample.large());
    EXPECT_EQ(std::get<std::uint64_t>(value.at("ularge")->content), sample.ularge());
    EXPECT_EQ(number(value, "warm"), double{sample.warm()});
    EXPECT_EQ(number(value, "damping"), sample.damping());
    EXPECT_EQ(text(value, "text"), sample.text());
    EXPECT_EQ(text(value, "short_text"), sample.short_text().c_str());
    EXPECT_EQ(value.at("mode")->enumerator(),
              (std::array{"MODE_OFF", "MODE_ON", "MODE_FAULT"}[sample.mode()]));
    EXPECT_EQ(number(value, "pose.y"), sample.pose().y());
    EXPECT_EQ(number(value, "pose.mark"), sample.pose().mark());
    EXPECT_EQ(number(value, "volts[2]"), sample.volts()[2]);
    EXPECT_EQ(number(value, "matrix[2][1]"), sample.matrix()[2][1]);
    EXPECT_EQ(number(value, "matrix[0][1]"), sample.matrix()[0][1]);
    EXPECT_EQ(number(value, "grid[1][0]"), sample.grid()[1][0]);
    EXPECT_EQ(number(value, "modes[1]"), sample.modes()[1]);
    EXPECT_EQ(number(value, "flags[2]"), sample.flags()[2] ? 1.0 : 0.0);
    EXPECT_THAT(std::get<Bytes>(value.at("raw")->content), ::testing::ElementsAreArray(sample.raw()));
    EXPECT_EQ(std::get<Bytes>(value.at("blob")->content), sample.blob());
    for (std::size_t i = 0; i < sample.currents().size(); ++i)
      EXPECT_EQ(number(value, "currents[" + std::to_string(i) + "]"), sample.currents()[i]);
    EXPECT_EQ(value.at("currents[" + std::to_string(sample.currents().size()) + "]"), nullptr);
    for (std::size_t i = 0; i < sample.shorts().size(); ++i)
      EXPECT_EQ(number(value, "shorts[" + std::to_string(i) + "]"), sample.shorts()[i]);
    for (std::size_t i = 0; i < sample.points().size(); ++i)
      EXPECT_EQ(number(value, "points[" + std::to_string(i) + "].x"), sample.points()[i].x());
    for (std::size_t i = 0; i < sample.names().size(); ++i)
      EXPECT_EQ(text(value, "names[" + std::to_string(i) + "]"), sample.names()[i].c_str());
    for (std::size_t i = 0; i < sample.texts().size(); ++i)
      EXPECT_EQ(text(value, "texts[" + std::to_string(i) + "].name"), sample.texts()[i].name().c_str());
    EXPECT_EQ(std::get<std::uint64_t>(value.at("last")->content), sample.last());
  }
}

TEST_P(EachOrder, WritesByteForByteWhatFastCdrWrites) {
  for (int round = 0; round < 200; ++round) {
    const Bytes payload = serialised(random_sample(random), GetParam());
    const auto decoded = decode(*type, payload);
    ASSERT_TRUE(decoded.ok());
    EXPECT_EQ(
        encode(decoded.value(), GetParam() == Cdr::BIG_ENDIANNESS ? std::endian::big : std::endian::little),
        payload);
  }
}

TEST_P(EachOrder, TellsOfEveryPayloadThatEndsTooSoon) {
  const Bytes payload = serialised(random_sample(random), GetParam());
  for (std::size_t size = 0; size < payload.size(); ++size) {
    const Bytes cut{payload.begin(),
                    payload.begin() + static_cast<std::ptrdiff_t>(size)};  // so that a sanitizer sees
    const auto decoded = decode(*type, cut);
    ASSERT_FALSE(decoded.ok()) << size;
    EXPECT_EQ(decoded.error(), size < 4 ? CdrFault::encapsulation : CdrFault::too_short) << size;
  }
}

TEST_P(EachOrder, SurvivesPayloadsWithAnyBytesChanged) {
  int refused = 0;
  for (int round = 0; round < 20'000; ++round) {
    Bytes payload = serialised(random_sample(random), GetParam());
    for (auto changes = 1 + random() % 4; changes > 0; --changes)
      payload[random() % payload.size()] = static_cast<std::uint8_t>(random() % 3 == 0 ? 0xFF : random());
    payload.shrink_to_fit();
    const auto decoded = decode(*type, payload);
    if (decoded.ok()) {
      (void)to_json_line(to_json(decoded.value()));
    } else {
      ++refused;
      EXPECT_THAT(std::string{sentence(decoded.error())}, ::testing::Not(IsEmpty()));
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(CdrTest, NamesWhatIsWrongWithAPayload) {
  const auto schema = parse_idl(
      "module t { struct B { boolean b; }; struct S { string<3> s; }; struct Q { sequence<short, 2> q; }; };",
      "t.idl");
  const auto fault = [&](const char* name, Bytes bytes) {
    const auto decoded = decode(*schema.find(name), bytes);
    return decoded.ok() ? "accepted" : std::string{sentence(decoded.error())};
  };
  EXPECT_EQ(fault("t::B", {0, 1, 0, 0, 1}), "accepted");
  EXPECT_EQ(fault("t::B", {0, 1, 0, 0, 1, 0, 0, 0}), "accepted") << "padding to 4 bytes";
  EXPECT_EQ(fault("t::B", {0, 1, 0, 0, 7}), "a boolean is neither 0 nor 1");
  EXPECT_EQ(fault("t::B", {0, 1, 0, 0, 1, 0, 0, 0, 0}), "the payload goes on after its type ends");
  EXPECT_EQ(fault("t::B", {0, 7, 0, 0, 1}), "the payload does not begin as plain CDR");
  EXPECT_EQ(fault("t::S", {0, 1, 0, 0, 3, 0, 0, 0, 'a', 'b', 0}), "accepted");
  EXPECT_EQ(fault("t::S", {0, 1, 0, 0, 0, 0, 0, 0}), "accepted") << "an empty text as some write it";
  EXPECT_EQ(fault("t::S", {0, 1, 0, 0, 3, 0, 0, 0, 'a', 'b', 'c'}), "a string does not end with a zero byte");
  EXPECT_EQ(fault("t::S", {0, 1, 0, 0, 5, 0, 0, 0, 'a', 'b', 'c', 'd', 0}),
            "a string or sequence is longer than its type allows");
  EXPECT_EQ(fault("t::S", {0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0}), "the payload ends before its type does");
  EXPECT_EQ(fault("t::Q", {0, 1, 0, 0, 3, 0, 0, 0, 1, 0, 2, 0, 3, 0}),
            "a string or sequence is longer than its type allows");
}

TEST(CdrTest, AnEnumerationValueWithoutANameShowsItsDigits) {
  const auto schema = parse_idl("enum E { A, B, @value(7) C }; struct S { E e; };", "t.idl");
  const auto decoded = decode(*schema.find("S"), Bytes{0, 1, 0, 0, 99, 0, 0, 0});
  ASSERT_TRUE(decoded.ok());
  EXPECT_EQ(decoded.value().at("e")->enumerator(), "99");
  const auto named = decode(*schema.find("S"), Bytes{0, 1, 0, 0, 7, 0, 0, 0});
  EXPECT_EQ(named.value().at("e")->enumerator(), "C");
}

TEST(IdlTest, ReadsUnitsKeysAndBounds) {
  const auto type = everything();
  ASSERT_NE(type, nullptr);
  EXPECT_EQ(type->members[0].name, "id");
  EXPECT_TRUE(type->members[0].key);
  const auto member = [&](const std::string& name) -> const Member& {
    return *std::find_if(type->members.begin(), type->members.end(),
                         [&](const Member& m) { return m.name == name; });
  };
  EXPECT_FALSE(member("flag").key);
  EXPECT_EQ(member("damping").unit, "N s/m");
  EXPECT_EQ(member("short_text").type->bound, 5U);
  EXPECT_EQ(member("volts").type->bound, 3U);
  EXPECT_EQ(member("points").type->bound, 4U);
  EXPECT_EQ(member("texts").type->element->name, "probe::inner::Text");
  EXPECT_EQ(member("matrix").type->bound, 3U);
  EXPECT_EQ(member("matrix").type->element->bound, 2U);
}

TEST(IdlTest, NamesTheLineAndTheMendOfEachFault) {
  const auto fault = [](const std::string& text) -> std::string {
    try {
      parse_idl(text, "t.idl");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(fault("struct A { long x; };\n"), "accepted");
  EXPECT_THAT(fault("struct A {\n  long x\n};"), HasSubstr("t.idl:3: `;` is missing before `}`"));
  EXPECT_THAT(fault("struct A {\n  Other x;\n};"), HasSubstr("t.idl:2: there is no type `Other`"));
  EXPECT_THAT(fault("struct A { long x; long x; };"), HasSubstr("two members `x`"));
  EXPECT_THAT(fault("struct A { long x; };\nstruct A { long y; };"),
              HasSubstr("t.idl:2: `A` is defined twice"));
  EXPECT_THAT(fault("struct A { };"), HasSubstr("without members"));
  EXPECT_THAT(fault("struct A { long x[0]; };"), HasSubstr("a length is no whole number"));
  EXPECT_THAT(fault("struct A { long x[N]; };"), HasSubstr("no constant `N`"));
  EXPECT_THAT(fault("struct A { wstring x; };"), HasSubstr("there is no type `wstring`"));
  EXPECT_THAT(fault("union U switch (long) { case 1: long x; };"), HasSubstr("`union` cannot be carried"));
  EXPECT_THAT(fault("@mutable struct A { long x; };"), HasSubstr("@mutable cannot be carried"));
  EXPECT_THAT(fault("struct A { @optional long x; };"), HasSubstr("@optional cannot be carried"));
  EXPECT_THAT(fault("struct A { long double x; };"), HasSubstr("`long double` cannot be carried"));
  EXPECT_THAT(fault("/* open"), HasSubstr("a comment is not closed"));
  EXPECT_THAT(fault("struct A { @unit(\"m) long x; };"), HasSubstr("a quoted text is not closed"));
  EXPECT_THAT(fault("module m {\n"), HasSubstr("t.idl:2:"));
  EXPECT_THAT(fault("struct A { $ };"), HasSubstr("`$` has no meaning here"));
  EXPECT_THAT(fault("@unit("), HasSubstr("an annotation is not closed"));
}

TEST(IdlTest, SurvivesTextsCutAnywhereAndWithAnyByteChanged) {
  std::ifstream file{INVAR_TEST_DATA "/recording/everything.idl"};
  const std::string whole{std::istreambuf_iterator<char>{file}, {}};
  const auto seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  std::mt19937_64 random{seed};
  const auto parse = [](const std::string& text) {
    try {
      parse_idl(text, "t.idl");
    } catch (const InputError&) {
    }
  };
  for (std::size_t size = 0; size < whole.size(); ++size) parse(whole.substr(0, size));
  for (int round = 0; round < 3000; ++round) {
    std::string text = whole;
    for (auto changes = 1 + random() % 3; changes > 0; --changes)
      text[random() % text.size()] = static_cast<char>(random());
    parse(text);
  }
}

TEST(IdlTest, EveryTypeOfTheCellIsBuiltInAndStandsAlone) {
  const auto names = built_in_type_names();
  EXPECT_THAT(names, Contains("invar::stage::AxisState"));
  for (const auto& name : names) {
    const auto* entry = built_in_type(name);
    EXPECT_EQ(entry->idl.find('#'), std::string_view::npos) << name << ": no preprocessor lines";
    const auto alone = parse_idl(entry->idl, name).find(name);
    ASSERT_NE(alone, nullptr) << name;
    const auto decoded = decode(*alone, encode(Value::zero(*alone)));
    EXPECT_TRUE(decoded.ok()) << name;
  }
  EXPECT_EQ(built_in_type("invar::stage::Nothing"), nullptr);
  const auto* axis = built_in_type("invar::stage::AxisState");
  ASSERT_NE(axis, nullptr);
  EXPECT_EQ(axis->type->members[3].unit, "m");
}

TEST(ColumnsTest, UnfoldStructuresArraysAndTheLongestSequence) {
  const auto schema = parse_idl(R"(
    enum Mode { OFF, ON };
    struct Point { @unit("m") double x; @unit("m") double y; };
    struct S {
      boolean ok; Mode mode; Point at; @unit("V") float volts[2]; sequence<Point> path; sequence<octet> image;
      string note; uint64 count; octet raw[2]; long many[5];
    };)",
                                "t.idl");
  const auto type = schema.find("S");
  Value value = Value::zero(*type);
  value.at("ok")->content = true;
  value.at("mode")->content = std::int64_t{1};
  value.at("at.x")->content = 0.1;
  value.at("volts[1]")->content = double{0.1F};
  value.at("count")->content = ~std::uint64_t{0};
  value.at("note")->content = std::string{"a,\"b\""};
  value.at("image")->content = Bytes{1, 2, 3};
  value.at("raw")->content = Bytes{7, 8};
  Columns columns{*type, 3};
  Value longer = value;
  longer.at("path")->content = std::vector<Value>(1, Value::zero(*schema.find("Point")));
  columns.widen(value);
  columns.widen(longer);
  std::string header;
  for (const auto& [path, unit] : columns.names()) header += path + "[" + unit + "] ";
  EXPECT_EQ(header,
            "ok[] mode[] at.x[m] at.y[m] volts[0][V] volts[1][V] path.length[] path[0].x[m] path[0].y[m] "
            "image.length[] note[] count[] raw[0][] raw[1][] many[0][] many[1][] many[2][] ");
  EXPECT_THAT(columns.shortened(), ElementsAre("many"));
  const auto line = [&](const Value& of) {
    std::vector<Cell> row;
    columns.fill(of, row);
    EXPECT_THAT(row, SizeIs(columns.names().size()));
    std::string text;
    for (const Cell& cell : row) append_cell(text, cell), text += ';';
    return text;
  };
  EXPECT_EQ(line(value), "1;ON;0.1;0;0;0.1;0;;;3;\"a,\"\"b\"\"\";18446744073709551615;7;8;0;0;0;");
  EXPECT_EQ(line(longer), "1;ON;0.1;0;0;0.1;1;0;0;3;\"a,\"\"b\"\"\";18446744073709551615;7;8;0;0;0;");
}

TEST(JsonTest, KeepsTheOrderOfTheMembersAndNamesEnumerators) {
  const auto schema = parse_idl(
      "enum E { A, B }; struct P { double z; double a; }; struct S { E e; P p; sequence<octet> o; double "
      "bad; char c; };",
      "t.idl");
  Value value = Value::zero(*schema.find("S"));
  value.at("p.z")->content = 1.5;
  value.at("o")->content = Bytes(100);
  value.at("bad")->content = std::nan("");
  value.at("c")->content = std::string{"x"};
  EXPECT_EQ(to_json_line(to_json(value)),
            R"({"e":"A","p":{"z":1.5,"a":0.0},"o":{"bytes":100},"bad":null,"c":"x"})");
}

}  // namespace
}  // namespace invar::recording
