// How heba fails. A bug is a CHECK; bad input throws InputError, which is caught once, in the application; an expected
// outcome of an algorithm (degenerate motion, no convergence, nothing found) is a value: Outcome.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include <glog/logging.h>

namespace heba {

// The command line, a config or an input file is wrong. `what()` is one sentence for the user: the file (and line or
// row), what is wrong, and what would be right. It is one line, whatever stands in the file: control characters become
// question marks.
class InputError : public std::runtime_error {
 public:
  explicit InputError(std::string message) : std::runtime_error(OneLine(std::move(message))) {}

 private:
  static std::string OneLine(std::string text) {
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
    }
    return text;
  }
};

// Why an algorithm has no result: one clause in plain words, without a full stop.
struct Failure {
  std::string reason;
};

// A value, or the reason why there is none.
template <class T>
class [[nodiscard]] Outcome {
 public:
  Outcome(T value) : result_(std::move(value)) {}            // NOLINT(google-explicit-constructor)
  Outcome(Failure failure) : result_(std::move(failure)) {}  // NOLINT(google-explicit-constructor)

  bool ok() const { return std::holds_alternative<T>(result_); }
  explicit operator bool() const { return ok(); }
  const T& operator*() const& { return Value(); }
  T& operator*() & { return Value(); }
  const T* operator->() const { return &Value(); }
  T* operator->() { return &Value(); }
  // Empty if there is a value.
  std::string reason() const { return ok() ? std::string() : std::get<Failure>(result_).reason; }

 private:
  const T& Value() const {
    CHECK(ok()) << reason();
    return std::get<T>(result_);
  }
  T& Value() {
    CHECK(ok()) << reason();
    return std::get<T>(result_);
  }
  std::variant<T, Failure> result_;
};

}  // namespace heba
