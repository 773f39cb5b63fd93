// What every page holds, built from tools/pages/web.
#pragma once

#include <string_view>

namespace heba {

std::string_view PageStyle();
// Empty if the program was built without Node.js.
std::string_view PageScript();
// "sha256-...", by which a page allows that script and no other.
std::string_view PageScriptHash();

}  // namespace heba
