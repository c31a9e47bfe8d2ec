// A job's transaction on the compensation: models are put to use on trial, then kept or taken back.
#include <stdexcept>

#include "components/calibration/calibration.hpp"
#include "components/calibration/deliver.hpp"

namespace invar::calibration {

std::uint64_t Calibration::send_model(compensation::ModelCommandKind kind, const std::string& path) {
  compensation::ModelCommand command;
  stamp(command);
  command.id(next_id());
  command.transaction(transaction_);
  command.kind(kind);
  command.path(path);
  model_.write(command);
  kept_at_ = now();
  return command.id();
}

Task Calibration::command_model(compensation::ModelCommandKind kind, const std::string& path) {
  const std::uint64_t command = send_model(kind, path);
  const Instant give_up = now() + Duration::seconds(5.0);
  for (;;) {
    co_await NextStep{};
    const auto* status = model_status_.latest();
    if (status != nullptr && status->command_id() == command) {
      if (status->state() == compensation::MODEL_REFUSED)
        throw std::runtime_error{"the compensation refused the model: " +
                                 std::string{status->text().c_str()}};
      co_return;
    }
    if (now() > give_up)
      throw std::runtime_error{
          "the compensation does not answer: it is not active, or it obeys a commander that ended within 2 "
          "s"};
  }
}

/// Begins the transaction: `layers` empty takes out all, "thermal" that of position and temperature.
Task Calibration::clear_models(const std::string& layers) {
  transaction_ = next_id();
  transaction_known_ = false;
  co_await command_model(compensation::MODEL_CLEAR, layers);
  transaction_known_ = true;
}

/// Activates a model on trial and waits until its correction is eased in.
Task Calibration::use_model(const std::filesystem::path& model) {
  std::string path;
  co_await deliver(*this, model_, model, path);
  co_await command_model(compensation::MODEL_STAGE, path);
  co_await command_model(compensation::MODEL_ACTIVATE, path);
  co_await wait(1.0);
}

Task Calibration::keep_models() {
  transaction_known_ = false;
  co_await command_model(compensation::MODEL_COMMIT, "");
  transaction_ = 0;
}

Task Calibration::roll_back(const std::string& why) {
  transaction_known_ = false;
  co_await command_model(compensation::MODEL_ROLLBACK, "");
  transaction_ = 0;
  throw std::runtime_error{why};
}

/// Shows that we live; and fails when the compensation no longer knows the transaction, restarted or rolled back by itself.
void Calibration::watch_transaction() {
  if (transaction_ == 0) return;
  if (now() - kept_at_ > Duration::seconds(1.0)) (void)send_model(compensation::MODEL_KEEP, "");
  const auto* status = model_status_.latest();
  if (!transaction_known_ || status == nullptr || status->transaction() == transaction_) return;
  const std::string text = status->text().c_str();
  transaction_ = 0;
  throw std::runtime_error{text.empty() ? "the compensation was restarted in the middle; nothing was kept"
                                        : "the compensation gave up: " + text};
}

void Calibration::abandon_transaction() {
  if (transaction_ != 0) (void)send_model(compensation::MODEL_ROLLBACK, "");
  transaction_ = 0;
}

}  // namespace invar::calibration
