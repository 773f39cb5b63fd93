#include "targets/render/qr_code.h"

#include <memory>

#include <qrencode.h>

#include "heba/base/error.h"

namespace heba {

QrCode EncodeQr(const std::string& text) {
  CHECK(!text.empty() && text.size() <= kMaxQrBytes) << text.size();
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> code(
      QRcode_encodeData(static_cast<int>(text.size()), reinterpret_cast<const unsigned char*>(text.data()),
                        /*version=*/0, QR_ECLEVEL_M),
      &QRcode_free);
  CHECK(code != nullptr) << "a text of this length has a code";
  QrCode result;
  result.size = code->width;
  for (int i = 0; i < code->width * code->width; ++i) result.is_black.push_back((code->data[i] & 1U) != 0);
  return result;
}

}  // namespace heba
