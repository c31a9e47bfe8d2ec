#include "components/calibration/model_transaction.hpp"

#include <stdexcept>

#include "core/job/deliver.hpp"
#include "core/job/wait.hpp"

namespace invar::calibration {

ModelTransaction::ModelTransaction(Component& owner, job::JobHost& host)
    : owner_{owner},
      host_{host},
      model_{owner, "model", "command"},
      status_{owner, "model_status", {.optional = true, .profile = "state"}} {}

std::uint64_t ModelTransaction::send(compensation::ModelCommandKind kind, const std::string& path) {
  compensation::ModelCommand command;
  owner_.stamp(command);
  command.id(host_.next_id());
  command.transaction(transaction_);
  command.kind(kind);
  command.path(path);
  model_.write(command);
  kept_at_ = owner_.now();
  return command.id();
}

job::Task ModelTransaction::command(compensation::ModelCommandKind kind, const std::string& path) {
  const std::uint64_t sent = send(kind, path);
  const Instant give_up = owner_.now() + Duration::seconds(5.0);
  for (;;) {
    co_await job::NextStep{};
    const auto* status = status_.latest();
    if (status != nullptr && status->command_id() == sent) {
      if (status->state() == compensation::MODEL_REFUSED)
        throw std::runtime_error{"the compensation refused the model: " +
                                 std::string{status->text().c_str()}};
      co_return;
    }
    if (owner_.now() > give_up)
      throw std::runtime_error{
          "the compensation does not answer: it is not active, or it obeys a commander that ended within 2 "
          "s"};
  }
}

job::Task ModelTransaction::clear(const std::string& layers) {
  transaction_ = host_.next_id();
  known_ = false;
  co_await command(compensation::MODEL_CLEAR, layers);
  known_ = true;
}

job::Task ModelTransaction::use(const std::filesystem::path& model) {
  std::string path;
  co_await job::deliver(owner_, model_, model, path);
  co_await command(compensation::MODEL_STAGE, path);
  co_await command(compensation::MODEL_ACTIVATE, path);
  co_await job::wait(owner_, 1.0);
}

job::Task ModelTransaction::keep() {
  known_ = false;
  co_await command(compensation::MODEL_COMMIT, "");
  transaction_ = 0;
}

job::Task ModelTransaction::roll_back(const std::string& why) {
  known_ = false;
  co_await command(compensation::MODEL_ROLLBACK, "");
  transaction_ = 0;
  throw std::runtime_error{why};
}

void ModelTransaction::watch() {
  if (transaction_ == 0) return;
  if (owner_.now() - kept_at_ > Duration::seconds(1.0)) (void)send(compensation::MODEL_KEEP, "");
  const auto* status = status_.latest();
  if (!known_ || status == nullptr || status->transaction() == transaction_) return;
  const std::string text = status->text().c_str();
  transaction_ = 0;
  throw std::runtime_error{text.empty() ? "the compensation was restarted in the middle; nothing was kept"
                                        : "the compensation gave up: " + text};
}

void ModelTransaction::abandon() {
  if (transaction_ != 0) (void)send(compensation::MODEL_ROLLBACK, "");
  transaction_ = 0;
}

}  // namespace invar::calibration
