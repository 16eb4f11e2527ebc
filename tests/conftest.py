from benchharness import platform

platform.use_variant("llvm_ad_rgb")
