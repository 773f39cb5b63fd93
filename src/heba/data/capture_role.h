// The purposes of captures in the two-step method.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace heba {

// kNone: the purpose is not stated.
enum class CaptureRole { kNone, kHome, kTranslateX, kTranslateY, kRotate, kFree };

// The names in files, in the order of CaptureRole; that of kNone is empty.
inline constexpr std::array<std::string_view, 6> kCaptureRoleNames = {"",       "home", "translate_x", "translate_y",
                                                                      "rotate", "free"};

inline std::string_view RoleName(CaptureRole role) { return kCaptureRoleNames[static_cast<size_t>(role)]; }

// Returns nothing if there is no role of this name.
std::optional<CaptureRole> FindCaptureRole(std::string_view name);

}  // namespace heba
