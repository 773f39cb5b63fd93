#include "tools/pages/photograph.h"

#include "heba/base/text.h"

namespace heba {
namespace {

std::string CirclesAt(const Points2& pixels, double radius_px, const char* colour) {
  std::string circles;
  for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
    circles += "<circle cx=\"" + Fixed(pixels(0, i) + 0.5, 1) + "\" cy=\"" + Fixed(pixels(1, i) + 0.5, 1) + "\" r=\"" +
               Fixed(radius_px, 1) + "\" fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"" +
               Fixed(radius_px / 3, 1) + "\"/>";
  }
  return circles;
}

}  // namespace

std::string BestPhotograph(const ReportData& data) {
  const CameraResiduals* camera = nullptr;
  const ReportedImage* best = nullptr;
  for (const CameraResiduals& one : data.residuals) {
    for (const ReportedImage& image : one.images) {
      if (image.small_jpeg.empty() || (best != nullptr && image.pixels.cols() <= best->pixels.cols())) continue;
      camera = &one;
      best = &image;
    }
  }
  if (best == nullptr) return "";
  const std::string width = std::to_string(camera->camera.width_px);
  const std::string height = std::to_string(camera->camera.height_px);
  const double radius_px = camera->camera.width_px / 160.0;
  const ImageResult& entry = data.result.images[best->entry];
  std::string caption = entry.image.empty() ? entry.capture : entry.image;
  caption += ": " + std::to_string(best->pixels.cols()) + " points";
  if (best->left_out_pixels.cols() > 0) caption += ", " + std::to_string(best->left_out_pixels.cols()) + " left out";
  return "<figure class=\"photograph\"><figcaption>" + EscapedForMarkup(caption) + "</figcaption><svg viewBox=\"0 0 " +
         width + " " + height + "\" role=\"img\" aria-label=\"" + EscapedForMarkup(caption) +
         "\"><image href=\"data:" + "image/jpeg;base64," + ToBase64(best->small_jpeg) + "\" width=\"" + width +
         "\" height=\"" + height + "\"/>" + CirclesAt(best->pixels, radius_px, "#35d0ff") +
         CirclesAt(best->left_out_pixels, radius_px, "#ff3344") + "</svg></figure>\n";
}

}  // namespace heba
