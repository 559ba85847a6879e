// PCL VoxelGrid: the centroid of the points of each cell, as a new cloud; counts are not kept.
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>

#include "peer.hpp"

int main(int argc, char** argv) {
  const peer::Arguments a = peer::parse(argc, argv);
  if (a.threads != 1) peer::fail("VoxelGrid has one thread");
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const peer::Point& p : peer::read_points(a)) cloud->push_back(pcl::PointXYZ(p.x, p.y, p.z));

  pcl::PointCloud<pcl::PointXYZ> centroids;
  pcl::VoxelGrid<pcl::PointXYZ> filter;
  const float side = static_cast<float>(a.cell);
  filter.setInputCloud(cloud);
  filter.setLeafSize(side, side, side);
  peer::Clock clock;
  filter.filter(centroids);
  clock.stop();
  peer::print("pcl-voxelgrid", a, cloud->size(), clock, centroids.size(), centroids.size() * sizeof(pcl::PointXYZ));
}
