#include "tools/config/image_list.h"

#include <algorithm>

#include <glob.h>

#include "heba/base/files.h"
#include "heba/base/text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::vector<fs::path> ListFolder(const ConfigValue& value, const fs::path& folder) {
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!HasImageSuffix(entry.path())) continue;
    if (!entry.is_regular_file()) value.Fail(entry.path().string() + " is not a regular file");
    images.push_back(entry.path());
  }
  if (images.empty()) value.Fail("the folder " + folder.string() + " contains no images");
  return images;
}

std::vector<fs::path> ExpandGlob(const ConfigValue& value, const fs::path& pattern) {
  glob_t found;
  std::vector<fs::path> images;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) images.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  if (images.empty()) value.Fail("no file matches " + pattern.string());
  return images;
}

}  // namespace

std::vector<fs::path> FindImages(const ConfigValue& value) {
  std::vector<fs::path> images;
  if (value.IsList()) {
    for (const ConfigValue& item : value.AsList()) {
      const fs::path path = item.AsPath();
      if (!fs::is_regular_file(path)) item.Fail("there is no image " + path.string() + FileMeant(path));
      images.push_back(path);
    }
    if (images.empty()) value.Fail("the list is empty; images are needed");
    return images;
  }
  const fs::path path = value.AsPath();
  if (fs::is_directory(path)) {
    images = ListFolder(value, path);
  } else if (path.string().find_first_of("*?[") != std::string::npos) {
    images = ExpandGlob(value, path);
  } else {
    value.Fail("there is no folder " + path.string() + "; a folder, a glob such as images/*.png, or a list is needed");
  }
  std::sort(images.begin(), images.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return images;
}

YAML::Node ImagesNode(const ConfigValue& value, const std::vector<fs::path>& images) {
  if (!value.IsList()) return YAML::Node(fs::absolute(value.AsPath()).lexically_normal().string());
  YAML::Node list;
  for (const fs::path& image : images) list.push_back(fs::absolute(image).lexically_normal().string());
  return list;
}

}  // namespace heba
