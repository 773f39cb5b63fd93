// QR codes (ISO/IEC 18004).
#pragma once

#include <string>
#include <vector>

namespace heba {

struct QrCode {
  int size = 0;                // Modules per side, without the quiet zone.
  std::vector<bool> is_black;  // Row by row.

  bool IsBlack(int row, int column) const { return is_black[static_cast<size_t>(row * size + column)]; }
};

// The width of the blank frame that a code needs on each side, in modules.
inline constexpr int kQrQuietModules = 4;
// The longest text that fits into a code, in bytes.
inline constexpr size_t kMaxQrBytes = 2000;

// Encodes bytes at error correction level M, which restores up to 15 % of the code. `text` must have 1 to kMaxQrBytes
// bytes.
QrCode EncodeQr(const std::string& text);

}  // namespace heba
