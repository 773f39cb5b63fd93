// Prediction of the observed pixels: of points by projection, of discs by the centroid of their image.
#pragma once

#include "heba/data/pair_problem.h"

namespace heba {

// Predicts the pixels of the observed points. `pixels` and, if not null, `jacobian` are resized to fit the
// observations. The first six rows of the Jacobian belong to a left perturbation of camera_from_target (p' = p + v + w
// x p: v in m, then w in rad), the others to the camera's parameters. Returns false if a point has no image from that
// pose.
//
// A disc (Observations::radii_m) is predicted by the centroid of its imaged area, because a fitted outline and a grey
// centroid measure this point. The image of the disc's centre differs from it by up to some tenths of a pixel, due to
// perspective and lens distortion (Ahn et al. 1999; with distortion: Song et al. 2024). The outline is projected at
// eight points, and the first moments of the area are computed from the trigonometric polynomial through them (Green's
// theorem; exact except for harmonics of the outline beyond the third). This works for any camera model and has exact
// derivatives.
bool Predict(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
             const Observations& observations, Points2* pixels, ProjectionJacobian* jacobian);

}  // namespace heba
