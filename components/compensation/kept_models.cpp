#include "components/compensation/kept_models.hpp"

#include <cstdio>
#include <fstream>
#include <set>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/compensation/model_file.hpp"

namespace invar::compensation {

namespace {

constexpr const char* list_name = "models.yaml";

std::string digits_of(std::uint32_t checksum) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%08x", checksum);
  return text.data();
}

std::string file_name(std::size_t place, const std::string& digits) {
  const std::string layer = place == 0 ? "geometric" : std::string{"thermal_"} + "xyz"[place - 1];
  return layer + "-" + digits + ".yaml";
}

std::vector<KeptModels::Entry> entries_of(const std::filesystem::path& folder, const config::Node& list) {
  std::vector<KeptModels::Entry> entries;
  for (const config::Node& model : list.children()) {
    if (const std::filesystem::path file = model.text("file"); file != file.filename())
      model["file"].fault("is no file of this folder", "name the file alone");
    entries.push_back({folder / model.text("file"), checksum_number(model.text("crc32"))});
  }
  return entries;
}

/// Copies the models into the folder and lists them below `key`.
void add(ModelText& list, const char* key, const std::filesystem::path& folder,
         const KeptModels::Selection& models, std::set<std::filesystem::path>& kept) {
  bool any = false;
  for (std::size_t place = 0; place < models.size(); ++place) {
    if (models[place] == nullptr) continue;
    if (!std::exchange(any, true)) list.open_list(key);
    const std::string digits = digits_of(models[place]->checksum);
    const std::filesystem::path file = folder / file_name(place, digits);
    if (kept.insert(file).second) {
      std::ofstream copy = new_stream(file);
      copy << models[place]->text;
      copy.close();
      if (!copy) throw InputError{file.string(), "cannot be written", "check the folder and the space left"};
    }
    list.item().text("file", file.filename().string()).text("crc32", digits);
  }
  if (any) list.close();
}

}  // namespace

KeptModels::Kept KeptModels::read(const std::filesystem::path& folder) {
  Kept kept;
  if (!std::filesystem::exists(folder / list_name)) return kept;
  kept.any = true;
  const auto yaml = config::Yaml::load(folder / list_name);
  if (check_seal(yaml) == 0)
    throw InputError{yaml.file().string(), "it carries no checksum", "calibrate again"};
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"kept"});
  kept.models = entries_of(folder, yaml.root()["models"]);
  if (yaml.root().integer("knows_before", 0, 1, 0) == 1)
    kept.before = entries_of(folder, yaml.root()["before"]);
  yaml.finish();
  return kept;
}

void KeptModels::write(const std::filesystem::path& folder, const Selections& models) {
  std::filesystem::create_directories(folder);
  ModelText list{"kept", {}};
  std::set<std::filesystem::path> kept;
  add(list, "models", folder, models.in_use, kept);
  list.integer("knows_before", models.before ? 1 : 0);
  if (models.before) add(list, "before", folder, *models.before, kept);
  list.write(folder / list_name);
  for (const auto& entry : std::filesystem::directory_iterator{folder}) {
    const std::string name = entry.path().filename().string();
    const bool ours = name.starts_with("geometric-") || name.starts_with("thermal_");
    if (ours && kept.count(entry.path()) == 0) std::filesystem::remove(entry.path());
  }
}

void KeptModels::write_waiting() noexcept {
  Selections models;
  while (waiting_.pop(models)) put(models);
}

void KeptModels::keep(const Selections& models) noexcept {
  if (folder_.empty()) return;
  if (owner_.simulated_time)
    put(models);
  else if (!waiting_.push(models))
    failed_ = true;
}

void KeptModels::put(const Selections& models) noexcept {
  try {
    write(folder_, models);
  } catch (const std::exception&) {
    failed_ = true;
  }
}

}  // namespace invar::compensation
