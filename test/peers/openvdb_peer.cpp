// OpenVDB through an accessor for each thread: `mask` (MaskGrid setValueOn), `float` (FloatGrid setValueOn with a
// constant: one float a voxel, no counting), `count` (FloatGrid counting points), `centroid` (a grid of count and
// sum of coordinates, four floats). Two and more threads: a tree each, then topologyUnion (mask only).
#include <openvdb/openvdb.h>

#include <cmath>
#include <thread>

#include "peer.hpp"

using CentroidTree = openvdb::tree::Tree4<openvdb::Vec4s, 5, 4, 3>::Type;

template <typename Tree, typename Write>
void fill(Tree& tree, const peer::Point* first, const peer::Point* last, float inverse, Write write) {
  openvdb::tree::ValueAccessor<Tree> accessor(tree);
  for (; first != last; ++first) {
    const openvdb::Coord cell(static_cast<int>(std::floor(first->x * inverse)), static_cast<int>(std::floor(first->y * inverse)),
                              static_cast<int>(std::floor(first->z * inverse)));
    write(accessor, cell, *first);
  }
}

template <typename Tree, typename Write>
void run(const char* sys, const peer::Arguments& a, const std::vector<peer::Point>& points, Tree& tree, Write write) {
  const float inverse = static_cast<float>(1.0 / a.cell);
  peer::Clock clock;
  fill(tree, points.data(), points.data() + points.size(), inverse, write);
  clock.stop();
  peer::print(sys, a, points.size(), clock, tree.activeVoxelCount(), tree.memUsage());
}

void run_mask_threads(const peer::Arguments& a, const std::vector<peer::Point>& points) {
  const float inverse = static_cast<float>(1.0 / a.cell);
  std::vector<openvdb::MaskTree> trees(static_cast<size_t>(a.threads));
  const auto mark = [](auto& accessor, const openvdb::Coord& cell, const peer::Point&) { accessor.setValueOn(cell); };
  peer::Clock clock;
  std::vector<std::thread> threads;
  for (size_t i = 0; i < trees.size(); ++i) {
    threads.emplace_back([&, i] {
      const size_t from = points.size() * i / trees.size(), to = points.size() * (i + 1) / trees.size();
      fill(trees[i], points.data() + from, points.data() + to, inverse, mark);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (size_t i = 1; i < trees.size(); ++i) trees[0].topologyUnion(trees[i]);
  clock.stop();
  peer::print("openvdb-mask", a, points.size(), clock, trees[0].activeVoxelCount(), trees[0].memUsage());
}

int main(int argc, char** argv) {
  const peer::Arguments a = peer::parse(argc, argv);
  const std::vector<peer::Point> points = peer::read_points(a);
  if (a.threads > 1) {
    if (a.mode != "mask") peer::fail("only --mode mask has threads");
    run_mask_threads(a, points);
  } else if (a.mode == "mask") {
    openvdb::MaskTree tree;
    run("openvdb-mask", a, points, tree, [](auto& at, const openvdb::Coord& c, const peer::Point&) { at.setValueOn(c); });
  } else if (a.mode == "float") {
    openvdb::FloatTree tree;
    run("openvdb-float", a, points, tree, [](auto& at, const openvdb::Coord& c, const peer::Point&) { at.setValueOn(c, 1.0f); });
  } else if (a.mode == "count") {
    openvdb::FloatTree tree;
    run("openvdb-count", a, points, tree, [](auto& at, const openvdb::Coord& c, const peer::Point&) {
      at.modifyValue(c, [](float& n) { n += 1.0f; });
    });
  } else if (a.mode == "centroid") {
    CentroidTree tree(openvdb::Vec4s(0.0f));
    run("openvdb-centroid", a, points, tree, [](auto& at, const openvdb::Coord& c, const peer::Point& p) {
      at.modifyValue(c, [&p](openvdb::Vec4s& sum) { sum += openvdb::Vec4s(p.x, p.y, p.z, 1.0f); });
    });
  } else {
    peer::fail("--mode is mask, float, count or centroid");
  }
}
