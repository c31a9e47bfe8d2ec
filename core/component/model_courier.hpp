// ModelCourier: brings a model that a component wrote to the PC of the component that shall use it.
#pragma once

#include <filesystem>
#include <future>
#include <string>

namespace invar {

class ModelCourier {
 public:
  virtual ~ModelCourier() = default;
  /// `topic`: of the output by which the model is commanded. The path under which the component behind it finds the file; the
  /// future throws std::runtime_error where it could not be brought. Not real-time; does not wait.
  [[nodiscard]] virtual std::future<std::filesystem::path> bring(const std::string& topic,
                                                                 const std::filesystem::path& file) = 0;
};

}  // namespace invar
