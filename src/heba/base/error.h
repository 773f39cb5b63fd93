// Error handling of heba. A bug is caught by a CHECK. Bad input throws InputError, which is caught once, in the
// application. An expected failure of an algorithm (degenerate motion, no convergence, an empty detection) is returned
// as a value: Outcome.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

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

class FailureCode;  // heba/base/failure_code.h.

// The reason why an algorithm has no result. Libraries set a code with figures and names, as a Finding has them
// (heba/evaluation/finding.h), and leave the words to whoever shows it to people. Functions that read or write files
// set the words alone.
struct Failure {
  using Numbers = std::vector<std::pair<std::string, double>>;
  using Names = std::vector<std::pair<std::string, std::string>>;

  // No failure.
  Failure() = default;
  Failure(FailureCode of_code, Numbers with_numbers = {}, Names with_names = {},  // NOLINT(google-explicit-constructor)
          std::vector<Failure> with_causes = {});
  explicit Failure(std::string words) : text(std::move(words)) {}

  bool empty() const { return code.empty() && text.empty(); }
  // Returns the text or, without one, the code with its figures, names and causes, for logs.
  std::string ToString() const;

  std::string code;             // Programs identify the failure by it; empty if there are only words.
  Numbers numbers;              // Each under a key that names it with its unit.
  Names names;                  // A list has several entries under one key.
  std::vector<Failure> causes;  // The failures that this one quotes.
  std::string text;             // One clause in plain words, without a full stop.
};

// Returns the failure of what was not run.
Failure NotRun();

// A value, or the reason why there is none.
template <class T>
class [[nodiscard]] Outcome {
 public:
  Outcome() : result_(NotRun()) {}
  Outcome(T value) : result_(std::move(value)) {}            // NOLINT(google-explicit-constructor)
  Outcome(Failure failure) : result_(std::move(failure)) {}  // NOLINT(google-explicit-constructor)

  bool ok() const { return std::holds_alternative<T>(result_); }
  explicit operator bool() const { return ok(); }
  const T& operator*() const& { return Value(); }
  T& operator*() & { return Value(); }
  T operator*() && { return std::move(Value()); }
  const T* operator->() const { return &Value(); }
  T* operator->() { return &Value(); }
  // Returns the failure; there must be no value.
  const Failure& failure() const { return std::get<Failure>(result_); }
  // Returns Failure::ToString, or an empty string if there is a value.
  std::string reason() const { return ok() ? std::string() : failure().ToString(); }

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
