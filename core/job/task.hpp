// Task: a job written from top to bottom that waits for the next step of its component where it has to.
#pragma once

#include <coroutine>
#include <exception>
#include <utility>

namespace invar::job {

/// A coroutine without a thread: `co_await NextStep{}` gives back control until the component is stepped again,
/// `co_await other_task` runs a part of the job. Exceptions travel to the awaiting task and to `resume`. Being driven by
/// steps alone, a job is repeatable in simulated time. Not real-time.
class Task {
 public:
  struct promise_type;
  using Handle = std::coroutine_handle<promise_type>;

  struct Final {
    bool await_ready() noexcept { return false; }
    std::coroutine_handle<> await_suspend(Handle ended) noexcept;
    void await_resume() noexcept {}
  };
  struct promise_type {
    std::coroutine_handle<> awaiting;
    Handle* innermost = nullptr;  // of the whole job: where to go on at the next step
    std::exception_ptr failure;
    Task get_return_object() { return Task{Handle::from_promise(*this)}; }
    std::suspend_always initial_suspend() noexcept { return {}; }
    Final final_suspend() noexcept { return {}; }
    void return_void() {}
    void unhandled_exception() { failure = std::current_exception(); }
  };

  Task() = default;
  Task(Task&& other) noexcept
      : handle_{std::exchange(other.handle_, {})}, innermost_{std::exchange(other.innermost_, {})} {}
  Task& operator=(Task&& other) noexcept {
    std::swap(handle_, other.handle_);
    std::swap(innermost_, other.innermost_);
    return *this;
  }
  ~Task() {
    if (handle_) handle_.destroy();
  }

  [[nodiscard]] bool running() const { return handle_ && !handle_.done(); }
  /// Goes on until the next `co_await NextStep{}`; throws what the job threw. Precondition: running().
  void resume() {
    if (innermost_ == nullptr) innermost_ = handle_;
    handle_.promise().innermost = &innermost_;
    innermost_.resume();
    if (handle_.done() && handle_.promise().failure) std::rethrow_exception(handle_.promise().failure);
  }

  /// Awaiting a task runs it at once, inside the awaiting one.
  auto operator co_await() && {
    struct Awaiter {
      Handle part;
      bool await_ready() { return false; }
      std::coroutine_handle<> await_suspend(Handle from) {
        part.promise().awaiting = from;
        part.promise().innermost = from.promise().innermost;
        *part.promise().innermost = part;
        return part;
      }
      void await_resume() {
        if (part.promise().failure) std::rethrow_exception(part.promise().failure);
      }
    };
    return Awaiter{handle_};
  }

 private:
  explicit Task(Handle handle) : handle_{handle} {}
  Handle handle_;
  Handle innermost_;
};

inline std::coroutine_handle<> Task::Final::await_suspend(Handle ended) noexcept {
  const auto outer = ended.promise().awaiting;
  if (!outer) return std::noop_coroutine();
  *ended.promise().innermost = Handle::from_address(outer.address());
  return outer;
}

/// Waits until the component is stepped again.
struct NextStep : std::suspend_always {};

}  // namespace invar::job
