; bound_bounded_speed: theory §2.6. f_max = fco + fd V + E'/(T V) beyond E' = fd T V^2 satisfies
; T D(f_max) = E', and is never below (13): what (13) allows is allowed here too.
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const T Real)
(declare-const V Real)
(declare-const E Real)
(declare-const x Real)   ; f_max - fco with bounded speed
(declare-const y Real)   ; f_max - fco of (13)
(assert (and (>= fd 0) (> T 0) (> V 0) (>= E 0)))
(assert (> E (* fd T V V)))  ; dropped in the twin
(assert (= (* T V x) (+ (* fd T V V) E)))
(assert (and (>= y 0) (= (* y y T) (* 4 fd E))))
(assert (>= (* (- E (* fd T V V)) (- E (* fd T V V))) 0))  ; hint
(assert (= (* T V x T V x) (* (+ (* fd T V V) E) (+ (* fd T V V) E))))  ; hint
(assert (= (* T V y T V y) (* 4 fd E T V V)))  ; hint
(assert (not (and (> x (* 2 fd V)) (= (* T V (- x (* fd V))) E) (>= (* T V x) (* T V y)))))  ; negated conclusion
(check-sat)
