// small_gicp voxelgrid_sampling (C++ headers of the PyPI source package): the centroid of the points of each cell,
// as a new vector of four doubles a point; counts are not kept. Two and more threads: its OpenMP form, which
// splits cells at the borders of its blocks.
#include <Eigen/Core>
#include <small_gicp/points/traits.hpp>

#include "peer.hpp"

// The leanest cloud that the templates take: positions only (the library's own PointCloud would also resize
// normals and covariances to the number of input points).
using Positions = std::vector<Eigen::Vector4d>;

namespace small_gicp::traits {
template <>
struct Traits<Positions> {
  static size_t size(const Positions& p) { return p.size(); }
  static bool has_points(const Positions& p) { return !p.empty(); }
  static const Eigen::Vector4d& point(const Positions& p, size_t i) { return p[i]; }
  static void resize(Positions& p, size_t n) { p.resize(n); }
  static void set_point(Positions& p, size_t i, const Eigen::Vector4d& point) { p[i] = point; }
};
}  // namespace small_gicp::traits

#include <small_gicp/util/downsampling.hpp>
#include <small_gicp/util/downsampling_omp.hpp>

int main(int argc, char** argv) {
  const peer::Arguments a = peer::parse(argc, argv);
  Positions positions;
  for (const peer::Point& p : peer::read_points(a)) positions.emplace_back(p.x, p.y, p.z, 1.0);

  peer::Clock clock;
  const auto centroids = a.threads > 1 ? small_gicp::voxelgrid_sampling_omp(positions, a.cell, a.threads)
                                       : small_gicp::voxelgrid_sampling(positions, a.cell);
  clock.stop();
  peer::print("small_gicp", a, positions.size(), clock, centroids->size(), centroids->size() * sizeof(Eigen::Vector4d));
}
