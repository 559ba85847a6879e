// Sends what headset_cloud takes over ROS-TCP-Endpoint: mesh, labels, camera and pose of a headset.
// No package is needed, in Unity or elsewhere; docs/headset.md shows its use. One thread at a time.
using System;
using System.IO;
using System.Text;

namespace Lattice
{
    /// <summary>A message in CDR, little-endian, as ROS 2 has it.</summary>
    public sealed class Cdr
    {
        readonly MemoryStream bytes = new MemoryStream();

        public Cdr() { bytes.Write(new byte[] { 0, 1, 0, 0 }, 0, 4); }
        public byte[] ToArray() { return bytes.ToArray(); }

        public Cdr Raw(byte[] of, int size)
        {
            // Numbers lie at multiples of their size, counted behind the four bytes at the front.
            while ((bytes.Length - 4) % size != 0) bytes.WriteByte(0);
            if (size > 1 && !BitConverter.IsLittleEndian)
                for (int i = 0; i < of.Length; i += size) Array.Reverse(of, i, size);
            bytes.Write(of, 0, of.Length);
            return this;
        }

        public Cdr Bool(bool v) { return Raw(new[] { (byte)(v ? 1 : 0) }, 1); }
        public Cdr Int(int v) { return Raw(BitConverter.GetBytes(v), 4); }
        public Cdr Doubles(params double[] all)
        {
            foreach (double v in all) Raw(BitConverter.GetBytes(v), 8);
            return this;
        }
        public Cdr Text(string text)
        {
            byte[] utf8 = Encoding.UTF8.GetBytes(text + "\0");
            return Int(utf8.Length).Raw(utf8, 1);
        }
        /// <summary>A sequence: part of an array of float, int, ushort or byte.</summary>
        public Cdr Part(Array all, int size, int first, int count)
        {
            byte[] part = new byte[count * size];
            Buffer.BlockCopy(all, first * size, part, 0, part.Length);
            return count == 0 ? Int(0) : Int(count).Raw(part, size);
        }
        public Cdr Header(double time_s, string frame)
        {
            double s = Math.Floor(time_s);
            return Int((int)s).Int((int)((time_s - s) * 1e9)).Text(frame);
        }
        /// <summary>Position x, y, z in m, rotation x, y, z, w; both in the axes of the headset.</summary>
        public Cdr Pose(double[] position_m, double[] rotation)
        {
            if (position_m.Length != 3 || rotation.Length != 4) throw new ArgumentException("three and four numbers");
            return Doubles(position_m).Doubles(rotation);
        }
    }

    /// <summary>A headset for headset_cloud. Times are in s since 1970, of one clock for all.</summary>
    public sealed class HeadsetSender
    {
        /// <summary>Numbers of each array in a message: 50 kB of vertices, triangles and classes.</summary>
        public int Chunk = 5000;
        readonly Stream stream;
        readonly string frame, camera;
        /// <summary>Registers its topics; `stream` is that of a TcpClient to the endpoint, port 10000.</summary>
        public HeadsetSender(Stream stream, string frame = "headset_origin", string camera = "headset_camera")
        {
            this.stream = stream; this.frame = frame; this.camera = camera;
            Register("headset/mesh", "lattice_msgs/HeadsetMesh", 100);
            Register("headset/labels/image", "sensor_msgs/Image", 5);
            Register("headset/camera_info", "sensor_msgs/CameraInfo", 5);
            Register("headset/pose", "geometry_msgs/PoseStamped", 100);
        }

        /// <summary>A surface of the mesh in place of the one of its name: x, y, z of each vertex, and three
        /// vertices of each triangle, as Unity has them. `classes` has one for each triangle, or none.</summary>
        public void Mesh(double time_s, string session, string surface, double[] position_m, double[] rotation,
            float[] vertices_m, int[] triangles, ushort[] classes)
        {
            int longest = Math.Max(vertices_m.Length, Math.Max(triangles.Length, classes.Length));
            int chunks = Math.Max(1, (longest + Chunk - 1) / Chunk);
            for (int i = 0; i < chunks; i++)
            {
                Cdr cdr = Surface(time_s, session, surface, false).Int(i).Int(chunks).Pose(position_m, rotation);
                foreach (Array all in new Array[] { vertices_m, triangles, classes })
                {
                    int first = Math.Min(i * Chunk, all.Length), end = Math.Min((i + 1) * Chunk, all.Length);
                    cdr.Part(all, all == (Array)classes ? 2 : 4, first, end - first);
                }
                Send("headset/mesh", cdr.ToArray());
            }
        }

        /// <summary>A surface is gone.</summary>
        public void Remove(double time_s, string session, string surface)
        {
            Cdr cdr = Surface(time_s, session, surface, true).Int(0).Int(1);
            cdr.Pose(new double[3], new double[] { 0, 0, 0, 1 }).Int(0).Int(0).Int(0);
            Send("headset/mesh", cdr.ToArray());
        }

        /// <summary>Classes of the pixels of an image, row by row from the upper left; 255: none.</summary>
        public void Labels(double time_s, int width, int height, byte[] classes)
        {
            if (classes.Length != width * height) throw new ArgumentException("one class for each pixel");
            Cdr cdr = new Cdr().Header(time_s, camera).Int(height).Int(width).Text("mono8").Bool(false).Int(width);
            Send("headset/labels/image", cdr.Part(classes, 1, 0, classes.Length).ToArray());
        }

        /// <summary>A camera without distortion: focal lengths and principal point in pixels.</summary>
        public void Camera(double time_s, int width, int height, double fx, double fy, double cx, double cy)
        {
            Cdr cdr = new Cdr().Header(time_s, camera).Int(height).Int(width).Text("plumb_bob").Int(5);
            cdr.Doubles(0, 0, 0, 0, 0).Doubles(fx, 0, cx, 0, fy, cy, 0, 0, 1).Doubles(1, 0, 0, 0, 1, 0, 0, 0, 1);
            cdr.Doubles(fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0);
            // No binning, and all of the image.
            Send("headset/camera_info", cdr.Int(0).Int(0).Int(0).Int(0).Int(0).Int(0).Bool(false).ToArray());
        }

        /// <summary>Pose of the camera at a time.</summary>
        public void Pose(double time_s, double[] position_m, double[] rotation)
        {
            Send("headset/pose", new Cdr().Header(time_s, frame).Pose(position_m, rotation).ToArray());
        }
        Cdr Surface(double time_s, string session, string surface, bool removed)
        {
            return new Cdr().Header(time_s, frame).Text(session).Text(surface).Bool(removed);
        }

        void Register(string topic, string type, int queue)
        {
            string json = "{'topic':'" + topic + "','message_name':'" + type + "','queue_size':" + queue + "}";
            Send("__publish", Encoding.UTF8.GetBytes(json.Replace('\'', '"') + "\0"));
        }

        /// <summary>A frame: length and name of the topic, length and bytes of the message.</summary>
        void Send(string topic, byte[] message)
        {
            byte[] name = Encoding.UTF8.GetBytes(topic);
            MemoryStream all = new MemoryStream();
            foreach (byte[] part in new[] { name, message })
            {
                for (int shift = 0; shift < 32; shift += 8) all.WriteByte((byte)(part.Length >> shift));
                all.Write(part, 0, part.Length);
            }
            all.WriteTo(stream);
        }
    }
}
