#include "tools/study/study_files.h"

#include "heba/base/files.h"
#include "tools/study/study_page.h"
#include "tools/study/study_tables.h"

namespace heba {

void WriteStudy(const StudyConfig& study, const std::vector<CellResult>& results, const std::filesystem::path& folder) {
  const std::filesystem::path plain = folder.lexically_normal();
  const std::filesystem::path name = plain.filename().empty() ? plain.parent_path().filename() : plain.filename();
  WriteFileAtomically(folder / "config.yaml", study.used);
  WriteFileAtomically(folder / "study.txt", StudyTable(results));
  WriteFileAtomically(folder / "study.html", StudyPage(name.string(), results));
  WriteFileAtomically(folder / "study.csv", StudyCsv(results));
}

}  // namespace heba
