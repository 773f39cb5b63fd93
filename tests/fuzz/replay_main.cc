// Runs a fuzz target without a fuzzer: on the seed corpus and on a fixed number of spoiled copies of it, identical
// each time.
// Usage: TARGET CORPUS_FOLDER COUNT
#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

#include "heba/base/rng.h"
#include "tests/fuzz/target.h"

namespace {

std::string Spoiled(std::string text, const std::vector<std::string>& seeds, heba::Rng& rng) {
  const int num_changes = 1 + rng.Index(4);
  for (int i = 0; i < num_changes; ++i) {
    const size_t at = text.empty() ? 0 : static_cast<size_t>(rng.Index(static_cast<int>(text.size())));
    switch (rng.Index(6)) {
      case 0:  // Replaces a byte.
        if (!text.empty()) text[at] = static_cast<char>(rng.Index(256));
        break;
      case 1:  // Truncates.
        text.resize(at);
        break;
      case 2:  // Inserts something that parsers stumble over.
        text.insert(at, std::vector<std::string>{"\n", ":", "[", "{", "\"", "nan", "1e999", "-", "&a ", "*a", "#", "\t",
                                                 ",", "99999999999999999999", std::string("\0", 1),
                                                 "\xff"}[static_cast<size_t>(rng.Index(16))]);
        break;
      case 3:  // Repeats a part.
        text.insert(at, text.substr(at, static_cast<size_t>(1 + rng.Index(40))));
        break;
      case 4:  // Removes a part.
        text.erase(at, static_cast<size_t>(1 + rng.Index(40)));
        break;
      default: {  // Inserts a part of another seed.
        const std::string& other = seeds[static_cast<size_t>(rng.Index(static_cast<int>(seeds.size())))];
        const size_t from = other.empty() ? 0 : static_cast<size_t>(rng.Index(static_cast<int>(other.size())));
        text.insert(at, other.substr(from, static_cast<size_t>(1 + rng.Index(60))));
      }
    }
  }
  return text;
}

void Run(const std::string& text) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(text.data()), text.size());  // NOLINT
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: " << argv[0] << " CORPUS_FOLDER COUNT\n";
    return 2;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> seeds;
  for (const std::filesystem::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
    Run(seeds.back());
  }
  if (seeds.empty()) {
    std::cerr << argv[1] << ": holds no seeds\n";
    return 2;
  }
  heba::Rng rng(1);
  const int count = std::atoi(argv[2]);
  for (int i = 0; i < count; ++i) {
    Run(Spoiled(seeds[static_cast<size_t>(rng.Index(static_cast<int>(seeds.size())))], seeds, rng));
  }
  std::cout << seeds.size() << " seeds and " << count << " spoiled copies\n";
  return 0;
}
