// Error handling of heba. A bug is caught by a CHECK. Bad input throws InputError, which is caught once, in the
// application. An expected failure of an algorithm (degenerate motion, no convergence, an empty detection) is returned
// as a value: Outcome.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include <glog/logging.h>

namespace heba {

// An error in the command line, in a config or in an input file. `what()` is one sentence for the user: the file (and
// line or row), what is wrong, and what would be right. It is always one line, because control characters, which a file
// may contain, are replaced by question marks.
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

// The reason why an algorithm has no result: one clause in plain words, without a full stop.
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
  // Returns the reason of the failure, or an empty string if there is a value.
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
