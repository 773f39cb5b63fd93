#include "heba/base/error.h"

#include <sstream>

#include "heba/base/failure_code.h"

namespace heba {

Failure::Failure(FailureCode of_code, Numbers with_numbers, Names with_names, std::vector<Failure> with_causes)
    : code(of_code.name()),
      numbers(std::move(with_numbers)),
      names(std::move(with_names)),
      causes(std::move(with_causes)) {}

std::string Failure::ToString() const {
  if (!text.empty()) return text;
  std::ostringstream shown;
  shown << code;
  const char* before = " (";
  const auto add = [&](const std::string& key, const auto& value) {
    shown << before << key << ' ' << value;
    before = ", ";
  };
  for (const auto& [key, value] : numbers) add(key, value);
  for (const auto& [key, value] : names) add(key, value);
  if (!numbers.empty() || !names.empty()) shown << ')';
  for (const Failure& cause : causes) shown << ": " << cause.ToString();
  return shown.str();
}

Failure NotRun() { return FailureCode("not_run"); }

}  // namespace heba
