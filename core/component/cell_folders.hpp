// CellFolders: the places in which a command that came over the network may name a file.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace invar {

/// A path in a command is anybody's: it must not open what only this PC's users may see, nor tell that it is there. So a file
/// is used where it lies, symbolic links followed, in one of the places of the cell. Not real-time.
class CellFolders {
 public:
  using Places = std::vector<std::filesystem::path>;
  /// `models`: folders and files to read from; `results`: folders to write to. One that is not there yet may come later.
  CellFolders(Places models, Places results) : models_{std::move(models)}, results_{std::move(results)} {}

  /// The model file that is meant. Nothing where it is in no place, is not there, cannot be read, is no plain .yaml file, or
  /// no model: nobody learns which.
  [[nodiscard]] std::optional<std::filesystem::path> model(const std::filesystem::path& named) const;
  /// The picture to write, a .png; nothing where it would lie in no place.
  [[nodiscard]] std::optional<std::filesystem::path> picture(const std::filesystem::path& named) const;

  static constexpr std::string_view no_model =
      "no model file of that name is in the folders of this cell: name its folder in `models` of the cell "
      "file, or give it "
      "by `invar job apply`";
  static constexpr std::string_view no_picture =
      "a picture is written as .png below a folder `out` of this cell, and nowhere else";

 private:
  Places models_, results_;
};

/// Whether a text is a model's: a line of it begins with the key of a model.yaml or a compensation.yaml.
[[nodiscard]] bool is_model_text(std::string_view text);

}  // namespace invar
