#include "core/vision/library.hpp"

#include "core/base/library.hpp"

namespace invar::vision {

const VisionLibrary& library() {
  using Entry = const VisionLibrary& (*)();
  static const VisionLibrary& loaded =
      reinterpret_cast<Entry>(library_entry("invar_vision", "invar_vision_library"))();
  return loaded;
}

}  // namespace invar::vision
