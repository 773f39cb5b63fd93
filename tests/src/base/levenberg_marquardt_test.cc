#include "heba/base/levenberg_marquardt.h"

#include <cmath>
#include <limits>
#include <optional>

#include <gtest/gtest.h>

namespace heba {
namespace {

// Rosenbrock's valley: r = (10 (y - x^2), 1 - x), with its minimum at (1, 1).
struct ValleyPoint {
  Eigen::Vector2d at;
  Eigen::Matrix2d normal;
  Eigen::Vector2d gradient;
  double cost = 0;
};

ValleyPoint At(const Eigen::Vector2d& at) {
  const Eigen::Vector2d residual(10 * (at.y() - at.x() * at.x()), 1 - at.x());
  Eigen::Matrix2d jacobian;
  jacobian << -20 * at.x(), 10, -1, 0;
  return {at, jacobian.transpose() * jacobian, jacobian.transpose() * residual, residual.squaredNorm()};
}

TEST(LevenbergMarquardtTest, FindsTheMinimumOfAValley) {
  ValleyPoint point = At({-1.2, 1});
  double least = point.cost;
  int num_rises = 0;
  const auto try_step = [&](const ValleyPoint& from, const Eigen::Vector2d& step) {
    num_rises += from.cost > least ? 1 : 0;
    least = from.cost;
    return std::optional<ValleyPoint>(At(from.at + step));
  };
  const auto end = MinimiseSquares({}, try_step, &point);
  EXPECT_TRUE(end.is_finite);
  EXPECT_LT((point.at - Eigen::Vector2d(1, 1)).norm(), 1e-6);
  EXPECT_EQ(num_rises, 0);
}

TEST(LevenbergMarquardtTest, ShortensStepsThatAreNotAllowed) {
  ValleyPoint point = At({-1.2, 1});
  int num_refused = 0;
  const auto try_step = [&](const ValleyPoint& from, const Eigen::Vector2d& step) -> std::optional<ValleyPoint> {
    const Eigen::Vector2d next = from.at + step;
    if (next.y() < 0 || step.norm() > 0.5) {
      ++num_refused;
      return std::nullopt;
    }
    return At(next);
  };
  MinimiseSquares({}, try_step, &point);
  EXPECT_GT(num_refused, 0);
  EXPECT_LT((point.at - Eigen::Vector2d(1, 1)).norm(), 1e-6);
}

TEST(LevenbergMarquardtTest, LeavesTheStepThatPromisesLittle) {
  LevenbergMarquardtOptions options;
  options.small_drop = 0.5;
  options.initial_damping = 1e-12;
  ValleyPoint point = At({0.99, 0.99 * 0.99 + 0.5});
  const auto try_step = [](const ValleyPoint& from, const Eigen::Vector2d& step) {
    return std::optional<ValleyPoint>(At(from.at + step));
  };
  const auto end = MinimiseSquares(options, try_step, &point);
  // Far from the minimum every Gauss-Newton step promises all of the cost.
  EXPECT_LT(point.cost, 1e-12);
  options.small_drop = 2;
  point = At({-1.2, 1});
  const auto unmoved = MinimiseSquares(options, try_step, &point);
  EXPECT_EQ(point.at, Eigen::Vector2d(-1.2, 1));
  ASSERT_TRUE(unmoved.remaining_step.has_value());
  EXPECT_GT(unmoved.remaining_step->norm(), 0);
  EXPECT_TRUE(end.is_finite);
}

TEST(LevenbergMarquardtTest, StopsWhereItIsTold) {
  ValleyPoint point = At({-1.2, 1});
  const auto try_step = [](const ValleyPoint& from, const Eigen::Vector2d& step) {
    return std::optional<ValleyPoint>(At(from.at + step));
  };
  MinimiseSquares({}, try_step, &point, [](const ValleyPoint& at) { return at.cost < 3; });
  EXPECT_LT(point.cost, 3);
  EXPECT_GT(point.cost, 1e-3);
}

TEST(LevenbergMarquardtTest, CountsTheStepsThatAreTried) {
  LevenbergMarquardtOptions options;
  options.max_tries = 3;
  int num_tries = 0;
  ValleyPoint point = At({-1.2, 1});
  const auto refuse = [&](const ValleyPoint&, const Eigen::Vector2d&) {
    ++num_tries;
    return std::optional<ValleyPoint>();
  };
  const auto end = MinimiseSquares(options, refuse, &point);
  EXPECT_EQ(num_tries, 3);
  EXPECT_EQ(point.at, Eigen::Vector2d(-1.2, 1));
  EXPECT_TRUE(end.is_finite);
  EXPECT_FALSE(end.remaining_step.has_value());
}

// Strong damping makes the first steps short: they decrease the cost by little although the minimum is far.
TEST(LevenbergMarquardtTest, GoesOnAfterASmallDropIfOnlyThePromiseCounts) {
  // The cost at the minimum is 1, so that a share of it can be small.
  const auto at = [](const Eigen::Vector2d& position) {
    ValleyPoint point = At(position);
    point.cost += 1;
    return point;
  };
  const auto try_step = [&](const ValleyPoint& from, const Eigen::Vector2d& step) {
    return std::optional<ValleyPoint>(at(from.at + step));
  };
  LevenbergMarquardtOptions options;
  options.initial_damping = 1e4;
  options.small_drop = 1e-2;
  options.trusted_damping = 1e-6;
  const ValleyPoint start = at({-1.2, 1});
  ValleyPoint point = start;
  const auto early = MinimiseSquares(options, try_step, &point);
  EXPECT_GT(point.cost, 0.9 * start.cost);
  EXPECT_FALSE(early.remaining_step.has_value());

  options.ends_after_small_drop = false;
  point = start;
  const auto late = MinimiseSquares(options, try_step, &point);
  EXPECT_LT(point.cost, 1 + 2 * options.small_drop);
  ASSERT_TRUE(late.remaining_step.has_value());
  EXPECT_LE(-late.remaining_step->dot(point.gradient), options.small_drop * point.cost);
}

TEST(LevenbergMarquardtTest, ReportsAStepThatIsNotFinite) {
  ValleyPoint point = At({-1.2, 1});
  point.gradient.x() = std::numeric_limits<double>::quiet_NaN();
  const auto try_step = [](const ValleyPoint&, const Eigen::Vector2d&) { return std::optional<ValleyPoint>(); };
  EXPECT_FALSE(MinimiseSquares({}, try_step, &point).is_finite);
}

}  // namespace
}  // namespace heba
