// octomap: `insert` (updateNode with lazy_eval, no rays; the inner nodes are never updated, which favours it),
// `rays` (insertPointCloud a scan, lazy_eval, no range limit) and `rays-discrete` (one ray for each end cell).
#include <octomap/octomap.h>

#include "peer.hpp"

int main(int argc, char** argv) {
  const peer::Arguments a = peer::parse(argc, argv);
  const std::vector<peer::Point> points = peer::read_points(a);
  const bool rays = a.mode == "rays" || a.mode == "rays-discrete";
  if (!rays && a.mode != "insert") peer::fail("--mode is insert, rays or rays-discrete");
  if (a.threads != 1) peer::fail("octomap has one thread");

  std::vector<octomap::Pointcloud> clouds;
  std::vector<octomap::point3d> origins;
  if (rays) {
    size_t at = 0;
    for (const peer::Scan& scan : peer::read_scans(a, points.size())) {
      octomap::Pointcloud cloud;
      cloud.reserve(scan.points);
      for (size_t end = at + scan.points; at < end; ++at) cloud.push_back(points[at].x, points[at].y, points[at].z);
      clouds.push_back(cloud);
      origins.emplace_back(static_cast<float>(scan.x), static_cast<float>(scan.y), static_cast<float>(scan.z));
    }
  }

  const uint64_t heap = peer::heap_bytes();
  octomap::OcTree tree(a.cell);
  peer::Clock clock;
  if (rays) {
    const bool discrete = a.mode == "rays-discrete";
    for (size_t i = 0; i < clouds.size(); ++i) tree.insertPointCloud(clouds[i], origins[i], -1.0, true, discrete);
  } else {
    for (const peer::Point& p : points) tree.updateNode(octomap::point3d(p.x, p.y, p.z), true, true);
  }
  clock.stop();
  const uint64_t bytes = peer::heap_bytes() - heap;

  uint64_t occupied = 0, known = 0;
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    occupied += tree.isNodeOccupied(*leaf);
    ++known;
  }
  peer::print("octomap-" + a.mode, a, points.size(), clock, occupied, bytes, rays ? known : 0);
}
