# Releases have no URL yet, so this formula builds a tarball of `meson dist`:
#   HOMEBREW_EBPO_TARBALL=/path/ebpo-octree-0.1.0.tar.xz brew install --formula ./ebpo.rb
class Ebpo < Formula
  desc "Octree of convex envelopes of triangle meshes, in one HDF5 file"
  url "file://#{ENV.fetch("HOMEBREW_EBPO_TARBALL", "/nonexistent/ebpo-octree-0.1.0.tar.xz")}"
  version "0.1.0"
  license "MIT"

  depends_on "meson" => :build
  depends_on "ninja" => :build
  depends_on "pkgconf" => :build
  depends_on "python@3.13" => :build
  depends_on "assimp"
  depends_on "cairo"
  depends_on "curl"
  depends_on "gmp"
  depends_on "hdf5"
  depends_on "jansson"
  depends_on "libpng"
  depends_on :linux
  depends_on "nettle"
  depends_on "numpy"
  depends_on "qhull"
  depends_on "zlib"
  depends_on "zstd"

  def install
    parts = %w[assimp http render captions qhull].map { |part| "-D#{part}=enabled" }
    # Homebrew has no Chart.js, so reports consist of data without a page.
    system "meson", "setup", "build", *std_meson_args, *parts, "-Dtests=disabled", "-Dchart_js=none"
    system "ninja", "-C", "build", "install", "-v"
  end

  test do
    (testpath/"cube.off").write <<~CUBE
      OFF
      8 12 0
      0 0 0
      1 0 0
      1 1 0
      0 1 0
      0 0 1
      1 0 1
      1 1 1
      0 1 1
      3 0 2 1
      3 0 3 2
      3 4 5 6
      3 4 6 7
      3 0 1 5
      3 0 5 4
      3 1 2 6
      3 1 6 5
      3 2 3 7
      3 2 7 6
      3 3 0 4
      3 3 4 7
    CUBE
    system bin/"ebpo", "convert", "cube.off", "cube.ebpo.h5"
    assert_equal "IN 1", pipe_output("#{bin}/ebpo inside cube.ebpo.h5", "0.5 0.5 0.5").strip
  end
end
