// Which names and texts from outside are taken, and how any bytes are shown.
#include "core/base/name.hpp"

#include <gmock/gmock.h>

#include "core/base/fault.hpp"

namespace invar {
namespace {

using ::testing::HasSubstr;

TEST(Identifier, HasLettersDigitsAndUnderscoreAndSaysWhichCharacterIsWrong) {
  for (const char* good : {"x", "stage_x", "Cell7", "_a"}) EXPECT_FALSE(flaw_of_identifier(good)) << good;
  EXPECT_FALSE(flaw_of_identifier("stage-pc", "-"));
  EXPECT_EQ(flaw_of_identifier("a`b")->what, "has ``` at byte 2");
  EXPECT_EQ(flaw_of_identifier("stage-pc")->what, "has `-` at byte 6");
  EXPECT_EQ(flaw_of_identifier("a\x1b[31m")->what, "has `\\x1b` at byte 2");
  EXPECT_EQ(flaw_of_identifier("s\xC3\xA4ule")->what, "has `\xC3\xA4` at byte 2");
  EXPECT_EQ(flaw_of_identifier("")->what, "is empty");
  EXPECT_EQ(flaw_of_identifier(std::string(32, 'a'))->what, "has 32 characters");
  EXPECT_FALSE(flaw_of_identifier(std::string(31, 'a')));
}

TEST(Label, TakesWhatHeadersOfTablesHave) {
  for (const char* good : {"x [mm]", "speed [\xC2\xB5m/s]", "T [\xC2\xB0\x43]", "R [\xCE\xA9]", "a`b", "$(x)",
                           "<b>", "Temp\xC3\xA9rature", "\xE6\xB8\xA9\xE5\xBA\xA6", ""})
    EXPECT_FALSE(flaw_of_label(good)) << good;
  EXPECT_THAT(flaw_of_label("a\nb")->what, HasSubstr("control character U+000a at byte 2"));
  EXPECT_THAT(flaw_of_label(std::string{"a\0b", 3})->what, HasSubstr("U+0000"));
  EXPECT_THAT(flaw_of_label("\x1b[2J")->what, HasSubstr("U+001b at byte 1"));
  EXPECT_THAT(flaw_of_label("\xC2\x9B")->what, HasSubstr("U+009b"));
  EXPECT_THAT(flaw_of_label("abc\xE2\x80\xAE")->what, HasSubstr("U+202e at byte 4"));
  EXPECT_THAT(flaw_of_label("a\xB5")->what, HasSubstr("0xb5 that is no UTF-8 at byte 2"));
  EXPECT_THAT(flaw_of_label(std::string(201, 'a'))->what, HasSubstr("201 bytes"));
  EXPECT_FALSE(flaw_of_text("two\n\tlines"));
}

TEST(Label, RefusesUtf8ThatIsTooLongCutOrNoCharacter) {
  for (const char* bad : {"\xC0\xAF", "\xE0\x80\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82", "\x80",
                          "\xF8\x88\x80\x80\x80"})
    EXPECT_TRUE(flaw_of_label(bad)) << printable(bad);
}

TEST(Printable, LeavesNothingThatATerminalActsUpon) {
  EXPECT_EQ(printable("a\x1b[31mb\r\nc"), "a\\x1b[31mb\\x0d\\x0ac");
  EXPECT_EQ(printable("5 \xC2\xB5m"), "5 \xC2\xB5m");
  EXPECT_EQ(printable("\xFF\xC2"), "\\xff\\xc2");
  EXPECT_EQ(printable_lines("a\n\tb\x07"), "a\n\tb\\x07");
  EXPECT_EQ(letters_of("a\x1b\n"), "a\xEF\xBF\xBD\n");
}

TEST(Fault, IsOneLineWhateverNamesStandInIt) {
  const InputError error{"a\nb.yaml", "`\x1b]0;title\x07` is no name", "mend\r"};
  EXPECT_STREQ(error.what(), "a\\x0ab.yaml: `\\x1b]0;title\\x07` is no name; mend\\x0d");
  EXPECT_LT(std::string{InputError(std::string(100'000, 'x'), "is long").what()}.size(), 4200u);
}

}  // namespace
}  // namespace invar
