// Tail probabilities and quantiles of the distributions that tests and confidence regions need.
#pragma once

namespace heba {

// Returns P(x > value) for chi-square with `dof` degrees of freedom; dof > 0, value >= 0.
double ChiSquareTail(double value, double dof);
// Returns the value that a chi-square variable exceeds with probability `tail`, 0 < tail < 1.
double ChiSquareQuantile(double tail, double dof);

// The same functions for Fisher's F with (dof1, dof2) degrees of freedom. If dof2 is infinite, F is chi-square divided
// by dof1.
double FisherTail(double value, double dof1, double dof2);
double FisherQuantile(double tail, double dof1, double dof2);

}  // namespace heba
