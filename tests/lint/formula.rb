# Enough of Homebrew for one formula to be evaluated: formula.rb FORMULA EBPO. Prints what it says and what
# its install would run, as JSON, and runs its test with the command that was built.
require "fileutils"
require "json"
require "open3"
require "pathname"
require "tmpdir"

# What formulas are derived from.
class Formula
  SAID = {}
  class << self
    %i[desc homepage url version license sha256].each { |word| define_method(word) { |value| SAID[word] = value } }

    def depends_on(what)
      (SAID[:depends_on] ||= []) << (what.is_a?(Hash) ? what.keys.first : what)
    end

    def test(&block)
      define_method(:run_test, &block)
    end
  end

  attr_reader :testpath, :bin, :calls

  def initialize(testpath, ebpo)
    @testpath = Pathname.new(testpath)
    @bin = @testpath/"bin"
    @bin.mkpath
    FileUtils.ln_s(ebpo, @bin/"ebpo")
    @calls = []
    @installs = true
  end

  def tested
    @installs = false
    Dir.chdir(testpath) { run_test }
  end

  def std_meson_args
    ["--prefix=/nowhere", "--libdir=/nowhere/lib", "--buildtype=release", "--wrap-mode=nofallback"]
  end

  def system(*words)
    words = words.map(&:to_s)
    return @calls << words if @installs

    Kernel.system(*words) or abort("#{words.join(" ")} failed")
  end

  def pipe_output(command, input)
    out, status = Open3.capture2(command, stdin_data: input)
    status.success? or abort("#{command} failed")
    out
  end

  def assert_equal(expected, actual)
    expected == actual or abort("expected #{expected.inspect}, got #{actual.inspect}")
  end
end

load ARGV[0]
Dir.mktmpdir do |folder|
  formula = Ebpo.new(folder, File.expand_path(ARGV[1]))
  formula.install
  $stdout.puts JSON.generate(Formula::SAID.merge(install: formula.calls))
  $stdout.flush
  formula.tested
end
