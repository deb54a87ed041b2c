import skops.io

skops.io.dump(fem.fit(T, F), "bridge.skops")

types = skops.io.get_untrusted_types(file="bridge.skops")  # look at them
saved = skops.io.load("bridge.skops", trusted=types)
predicted = saved.predict(later.temperatures)
