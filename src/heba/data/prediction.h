// Where the camera sees what was observed: points, and discs by the centroid of their image.
#pragma once

#include "heba/data/problem.h"

namespace heba {

// `pixels` and, if not null, `jacobian` are resized to fit the observations. The jacobian's rows are the six of a left
// perturbation of camera_from_target (p' = p + v + w x p: v in m, then w in rad), then the camera's parameters. False
// if something has no image from that pose.
//
// A disc (Observations::radii_m) is predicted by the centroid of its imaged area, which is what a fitted outline and a
// grey centroid measure; the image of its centre lies up to some tenths of a pixel away from it by perspective and
// lens (Ahn et al. 1999; with distortion: Song et al. 2024). The outline is projected at eight points and the area's
// first moments are taken of the trigonometric polynomial through them (Green's theorem; exact but for harmonics of
// the outline beyond the third): any camera model, with exact derivatives.
bool Predict(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
             const Observations& observations, Points2* pixels, ProjectionJacobian* jacobian);

}  // namespace heba
