#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace strata {

using Vec2f = Eigen::Vector2f;
using Vec3f = Eigen::Vector3f;
using Vec4f = Eigen::Vector4f;
using Vec2d = Eigen::Vector2d;
using Vec3d = Eigen::Vector3d;
using Vec4d = Eigen::Vector4d;
using Vec2i = Eigen::Matrix<int32_t, 2, 1>;
using Vec3i = Eigen::Matrix<int32_t, 3, 1>;
using Mat3d = Eigen::Matrix3d;
using Mat4d = Eigen::Matrix4d;
using Mat4f = Eigen::Matrix4f;

}  // namespace strata
