// Tail probabilities and quantiles of the distributions that tests and confidence regions need.
#pragma once

#include <Eigen/Core>

namespace heba {

// Returns P(x > value) for chi-square with `dof` degrees of freedom; dof > 0, value >= 0.
double ChiSquareTail(double value, double dof);
// Returns the value that a chi-square variable exceeds with probability `tail`, 0 < tail < 1.
double ChiSquareQuantile(double tail, double dof);

// The same functions for Fisher's F with (dof1, dof2) degrees of freedom. If dof2 is infinite, F is chi-square divided
// by dof1.
double FisherTail(double value, double dof1, double dof2);
double FisherQuantile(double tail, double dof1, double dof2);

// Returns the radius of the ball around the mean that contains a Gaussian point with probability `confidence`,
// 0 < confidence < 1. The noise on which its covariance is based is known with `dof` degrees of freedom, such as
// PairSolution::covariance_dof, which may be infinite. The squared distance is a weighted sum of chi-squares,
// approximated by its first two moments (Satterthwaite 1946). Returns 0 for a covariance of zero.
double ConfidenceRadius(const Eigen::Matrix3d& covariance, double confidence, double dof);

}  // namespace heba
