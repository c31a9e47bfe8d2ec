#include "core/recording/type_book.hpp"

#include <map>

#include "idl/idl_texts.hpp"

namespace invar::recording {

namespace {

std::map<std::string, BuiltInType> read_book() {
  std::map<std::string, BuiltInType> book;
  for (const IdlText& text : idl_texts()) {
    for (const auto& [name, type] : parse_idl(text.text, std::string{text.file}).types) {
      if (type->kind != Kind::structure) continue;
      // A file that includes another holds its types too; the shortest text that has it is the one that defines it.
      auto& entry = book[name];
      if (entry.type == nullptr || text.text.size() < entry.idl.size()) entry = {type, text.text};
    }
  }
  return book;
}

const std::map<std::string, BuiltInType>& book() {
  static const auto it = read_book();
  return it;
}

}  // namespace

const BuiltInType* built_in_type(const std::string& name) {
  const auto found = book().find(name);
  return found == book().end() ? nullptr : &found->second;
}

std::vector<std::string> built_in_type_names() {
  std::vector<std::string> names;
  for (const auto& [name, entry] : book()) names.push_back(name);
  return names;
}

}  // namespace invar::recording
