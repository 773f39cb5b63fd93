// The tests share the precompiled headers of this source, which has nothing else.
