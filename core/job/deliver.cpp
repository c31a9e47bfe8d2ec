#include "core/job/deliver.hpp"

#include <chrono>
#include <future>
#include <utility>

#include "core/component/component.hpp"
#include "core/component/model_courier.hpp"

namespace invar::job {

Task deliver(const Component& owner, const Port& output, std::filesystem::path file, std::string& found) {
  found = file.string();
  if (!owner.courier) co_return;
  auto brought = owner.courier->bring(output.topic, file);
  const auto arrived = [&] { return brought.wait_for(std::chrono::seconds{0}) == std::future_status::ready; };
  while (!owner.simulated_time && !arrived()) co_await NextStep{};
  found = brought.get().string();
}

}  // namespace invar::job
