// Writes to its output what a headset sends of a wall before it: for test/tests/nodes/headset_cloud/unity.rs.
using System;
using System.IO;
using Lattice;

static class Frames
{
    static void Main()
    {
        using (Stream output = Console.OpenStandardOutput())
        {
            HeadsetSender sender = new HeadsetSender(output);
            double[] none = { 0, 0, 0 }, straight = { 0, 0, 0, 1 };
            // A square of 2 m, clockwise from where the headset stands, 3 m along z.
            float[] square = { -1, -1, 0, -1, 1, 0, 1, 1, 0, 1, -1, 0 };
            int[] triangles = { 0, 1, 2, 0, 2, 3 };
            double[] ahead = { 0, 0, 3 }, left = { -50, 0, 0 };
            sender.Mesh(10.25, "first", "wall", ahead, straight, square, triangles, new ushort[] { 7, 8 });
            // A second surface, in chunks, far to the left, and gone again.
            sender.Chunk = 8;
            sender.Mesh(10.5, "first", "curtain", left, straight, square, triangles, new ushort[0]);
            sender.Remove(10.75, "first", "curtain");
            sender.Camera(10.0, 4, 2, 4, 4, 1.5, 0.5);
            sender.Pose(10.875, none, straight);
            sender.Pose(11.0, none, straight);
            sender.Labels(11.0, 4, 2, new byte[] { 1, 2, 3, 4, 5, 6, 255, 8 });
        }
    }
}
