// The style sheet and the script of every page, built from tools/pages/web.
#pragma once

#include <string_view>

namespace heba {

std::string_view PageStyle();
// Returns an empty text if the program was built without Node.js.
std::string_view PageScript();
// Returns "sha256-...", the hash by which a page's content security policy allows this script only.
std::string_view PageScriptHash();

}  // namespace heba
