# STYLE, and SCRIPT with its HASH if there is one, as a C++ source OUT that defines tools/pages/page_assets.h.
set(script "")
set(hash "")
file(READ ${STYLE} style)
if(SCRIPT)
  file(READ ${SCRIPT} script)
  file(READ ${HASH} hash)
endif()
foreach(text style script)
  string(FIND "${${text}}" ")heba\"" at)
  if(NOT at EQUAL -1)
    message(FATAL_ERROR "the page's ${text} holds what would end it")
  endif()
endforeach()
file(WRITE ${OUT}
"#include \"tools/pages/page_assets.h\"
#pragma GCC diagnostic ignored \"-Woverlength-strings\"
namespace heba {
std::string_view PageStyle() { return R\"heba(${style})heba\"; }
std::string_view PageScript() { return R\"heba(${script})heba\"; }
std::string_view PageScriptHash() { return \"${hash}\"; }
}  // namespace heba
")
